"""Speed, position and borders of every method under the manual ones (like figure 4.6)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from besman.evaluation.segmentation_data import SegmentedDataset
from besman.io.atomic_files import make_folder, written_aside
from besman.records import LabelledRecording, LabelledSegments, Segments
from besman.stages.segment.scores import manual_borders

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARKER = "hand_top"
_MOST_FIGURES = 6
_SPEED = "#1a1a1a"
_AXES = ("#0072b2", "#009e73", "#cc79a7")
_BORDER = "#d55e00"


def draw_dataset(
    dataset: SegmentedDataset, found: dict[str, tuple[Segments, ...]], folder: Path
) -> None:
    """Draw the first recordings of a dataset, one PNG each.

    Parameters
    ----------
    dataset : SegmentedDataset
        Recordings and truth.
    found : dict of tuple of Segments
        Segments of every recording by method.
    folder : Path
        Made if need be; figures are named DATASET_SOURCE_RECORDING.png.
    """
    make_folder(folder)
    for index, recording in enumerate(dataset.recordings[:_MOST_FIGURES]):
        segments = {name: results[index] for name, results in found.items()}
        figure = draw_recording(recording, dataset.truth[index], segments)
        figure.suptitle(f"{dataset.name} ({dataset.source}): {recording.source}", fontsize=10)
        name = f"{dataset.name}_{dataset.source}_{Path(recording.source).stem}.png"
        with written_aside(folder / name) as temporary:
            figure.savefig(temporary, dpi=110, metadata={"Software": None})


def draw_recording(
    recording: LabelledRecording, truth: LabelledSegments, segments: dict[str, Segments]
) -> Figure:
    """Draw one recording: a panel for the truth, one for each method, one for each posterior.

    Parameters
    ----------
    recording : LabelledRecording
        With the marker ``hand_top``.
    truth : LabelledSegments
        Manual segments.
    segments : dict of Segments
        By method.

    Returns
    -------
    Figure
    """
    from matplotlib.figure import Figure

    weighed = {name: each for name, each in segments.items() if each.border_probability.size}
    n_panels = 1 + len(segments) + len(weighed)
    heights = [1.0] * (1 + len(segments)) + [0.5] * len(weighed)
    figure = Figure(figsize=(10, 0.6 + 1.35 * sum(heights)), layout="constrained")
    panels = figure.subplots(n_panels, 1, sharex=True, gridspec_kw={"height_ratios": heights})
    panels = np.atleast_1d(panels)
    true = manual_borders(truth)
    panels_of = dict(zip(["manual", *segments], panels, strict=False))
    for name, axes in panels_of.items():
        borders = true if name == "manual" else np.unique(segments[name].bounds)[1:-1]
        _draw_movement(axes, recording, borders, "k" if name == "manual" else _BORDER)
        axes.set_title(name, loc="left", fontsize=9, pad=2)
    panels[0].set_ylim(0, 1.4 * panels[0].get_ylim()[1])
    _write_labels(panels[0], truth)
    for axes, (name, each) in zip(panels[1 + len(segments) :], weighed.items(), strict=True):
        time = np.arange(len(each.border_probability)) / recording.rate_hz
        axes.fill_between(time, each.border_probability, color=_BORDER, step="mid", linewidth=0)
        for border in true:
            axes.axvline(border / recording.rate_hz, color="k", linewidth=0.6, linestyle=":")
        axes.set_ylim(0, 1)
        axes.set_title(f"{name}: probability of a border", loc="left", fontsize=9, pad=2)
    panels[-1].set_xlabel("time [s]")
    panels[-1].set_xlim(0, len(recording.time) / recording.rate_hz)
    figure.supylabel("speed [m/s], black; position x, y, z, dashed", fontsize=8)
    return figure


def _draw_movement(
    axes: Axes, recording: LabelledRecording, borders: npt.NDArray[np.int64], colour: str
) -> None:
    """Draw speed and position of the hand, and borders."""
    path = recording.marker(_MARKER)
    time = np.arange(len(path)) / recording.rate_hz
    speed = np.linalg.norm(np.gradient(path, axis=0), axis=1) * recording.rate_hz
    axes.plot(time, speed, color=_SPEED, linewidth=1.0)
    axes.set_ylim(0, 1.05 * speed.max() if speed.max() > 0 else 1.0)
    position = axes.twinx()
    for column, axis_colour in zip((path - path.mean(axis=0)).T, _AXES, strict=True):
        position.plot(time, column, color=axis_colour, linewidth=0.7, linestyle="--")
    position.set_yticks([])
    for border in borders:
        axes.axvline(border / recording.rate_hz, color=colour, linewidth=1.4)
    axes.tick_params(labelsize=7)


def _write_labels(axes: Axes, truth: LabelledSegments) -> None:
    """Write the manual labels into their segments, on two levels so that they do not touch."""
    shown = [
        (bounds, label)
        for bounds, label in zip(truth.bounds, truth.labels, strict=True)
        if not label.endswith("_part")
    ]
    for index, ((start, end), label) in enumerate(sorted(shown, key=lambda pair: pair[0][0])):
        axes.text(
            (start + end) / 2 / truth.rate_hz,
            0.97 - 0.13 * (index % 2),
            label.replace("_", " "),
            transform=axes.get_xaxis_transform(),
            fontsize=6,
            ha="center",
            va="top",
        )
