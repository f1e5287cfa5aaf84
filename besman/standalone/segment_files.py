"""Segmentation of recordings without a pipeline."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from besman.config.yaml_file import parse_config
from besman.exceptions import ConfigError, nearest
from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import read_recording
from besman.person.marker_set import load_marker_set
from besman.stages.label.methods import DefaultLabelConfig
from besman.stages.segment.methods import CONFIGS
from besman.standalone import LONGEST_GAP_S

if TYPE_CHECKING:
    from rich.table import Table


def segment_files(
    paths: list[Path],
    method: str,
    markers: str,
    rate_hz: float | None,
    learn_from: Path | None = None,
) -> list[dict[str, Any]]:
    """Segment recordings.

    Parameters
    ----------
    paths : list of Path
        Files or folders.
    method : str
        Segmentation method.
    markers : str
        Marker set.
    rate_hz : float, optional
        Sampling rate of the method; its default if not given.
    learn_from : Path, optional
        A recording with names, by which trajectories without names are named.

    Returns
    -------
    list of dict
        recording; rate_hz of the recording; borders_s, seconds from its start, first 0 and last
        its end; frames, the borders as the recording's frame numbers; labels, None without a
        trained model.

    Raises
    ------
    BesmanError
        If a recording cannot be read, labelled or segmented, or there is no such method.
    """
    marker_set = load_marker_set(markers)
    content: dict[str, Any] = {"method": method}
    if marker_set.hand:
        content["markers"] = marker_set.hand
    if rate_hz is not None:
        content["rate_hz"] = rate_hz
    if method not in CONFIGS:
        raise ConfigError(f"besman segment: --method: got {method!r}; {nearest(method, CONFIGS)}")
    config = parse_config(content, CONFIGS[method], "besman segment")
    label = DefaultLabelConfig(markers=markers, longest_gap_s=LONGEST_GAP_S)
    teacher = None if learn_from is None else read_recording(learn_from)
    found = []
    for path in find_recordings(paths):
        # Nothing holds the recording any longer once it is labelled.
        labelled = label.run((read_recording(path),), marker_set, teacher)
        (segments,) = config.run(labelled)
        borders = [*segments.bounds[:, 0].tolist(), int(segments.bounds[-1, 1])]
        found.append(
            {
                "recording": segments.source,
                "rate_hz": segments.rate_hz,
                "borders_s": [border / segments.rate_hz for border in borders],
                "frames": [segments.first_frame + border for border in borders],
                "labels": None,
            }
        )
    return found


def segment_table(found: list[dict[str, Any]]) -> Table:
    """Return what `segment_files` found as a table for the terminal."""
    from rich.table import Table

    table = Table("recording", "rate [Hz]", "segments", "borders [s]")
    for row in found:
        borders = " ".join(f"{border:.2f}" for border in row["borders_s"])
        table.add_row(
            row["recording"], f"{row['rate_hz']:g}", str(len(row["borders_s"]) - 1), borders
        )
    return table
