"""What segmentation is measured on: real recordings, and simulated ones of thesis 4.4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from besman.exceptions import RecordingError
from besman.person.marker_set import load_marker_set
from besman.records import LabelledRecording, LabelledSegments, Recording
from besman.records.layers import building_blocks
from besman.stages.label.stage import LabelConfig
from besman.stages.read.read_inputs import read_inputs

SIMULATED = ("step", "stick_throw", "pick_and_place")
N_SUBJECTS = 3
N_REPETITIONS = 6
_LONGEST_GAP_S = 0.5


@dataclass(frozen=True)
class ThesisTable:
    """How a dataset was looked at in the thesis, and what came out.

    Attributes
    ----------
    number : str
        Of the table.
    rate_hz : float
        Rate that recordings were brought to.
    margin_s : float
        Greatest distance of a border that counts as found.
    windows_s : tuple of float
        Windows of locmin and of the cuts of probs.
    figures : dict
        F1, true and false positives by method.
    """

    number: str
    rate_hz: float
    margin_s: float
    windows_s: tuple[float, float]
    figures: dict[str, tuple[float, float, float]]


THESIS = {
    "step": ThesisTable(
        "4.2",
        30.0,
        0.2,
        (0.27, 0.13),
        {
            "vmci": (0.85, 6.0, 1.1),
            "mci": (0.63, 4.0, 1.2),
            "locmin": (0.83, 7.0, 3.7),
            "bp_ar_hmm": (0.81, 6.9, 3.1),
            "probs": (0.18, 1.5, 1.9),
        },
    ),
    "stick_throw": ThesisTable(
        "4.3",
        30.0,
        0.2,
        (0.2, 0.07),
        {
            "vmci": (0.70, 1.9, 0.9),
            "mci": (0.58, 1.5, 0.9),
            "locmin": (0.71, 2.0, 1.8),
            "bp_ar_hmm": (0.56, 2.0, 2.5),
            "probs": (0.23, 0.6, 1.0),
        },
    ),
    "pick_and_place": ThesisTable(
        "4.4",
        20.0,
        0.3,
        (0.2, 0.1),
        {
            "vmci": (0.67, 5.0, 3.0),
            "mci": (0.60, 4.9, 4.0),
            "locmin": (0.79, 6.5, 3.0),
            "bp_ar_hmm": (0.52, 6.3, 10.7),
            "probs": (0.32, 1.6, 1.1),
        },
    ),
}
"""Tables 4.2 to 4.4, by dataset."""


@dataclass(frozen=True)
class SegmentedDataset:
    """Recordings with their true segments.

    Attributes
    ----------
    name : str
        For example ``pick_and_place``.
    source : str
        ``real`` or ``synthetic``.
    recordings : tuple of LabelledRecording
    truth : tuple of LabelledSegments
        One each.
    table : ThesisTable
        How it is looked at; that of ``pick_and_place`` where the thesis has no such dataset.
    settings : dict
        Fields of a method's config that differ from its defaults, by method.
    """

    name: str
    source: str
    recordings: tuple[LabelledRecording, ...]
    truth: tuple[LabelledSegments, ...]
    table: ThesisTable
    settings: dict[str, dict[str, Any]] = field(default_factory=dict)


def read_dataset(
    folder: Path, source: str = "real", markers: str = "right_arm"
) -> SegmentedDataset:
    """Read recordings that have a segments file beside them.

    Parameters
    ----------
    folder : Path
        Folder of recordings, or one recording; its name is the dataset's.
    source : str
        ``real`` or ``synthetic``: a file does not tell.
    markers : str
        Marker set.

    Returns
    -------
    SegmentedDataset

    Raises
    ------
    RecordingError
        If there is no recording with manual segments, or a file cannot be read.
    """
    inputs = read_inputs([str(folder)])
    pairs = [
        (recording, blocks)
        for recording, truth in zip(inputs.recordings, inputs.truth, strict=True)
        if truth is not None and (blocks := building_blocks(truth)) is not None
    ]
    if not pairs:
        raise RecordingError(
            f"{folder}: none of {len(inputs.recordings)} recordings has manual segments beside it "
            "(STEM_manually_segmented.json)"
        )
    recordings, truth = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    return _make(folder.resolve().stem, source, recordings, truth, markers)


def simulate_dataset(name: str, seed: int = 0) -> SegmentedDataset:
    """Simulate the recordings of a dataset of the thesis.

    Parameters
    ----------
    name : str
        One of `SIMULATED`.
    seed : int
        Another seed, other people.

    Returns
    -------
    SegmentedDataset
    """
    from besman.synthetic import datasets

    captures = list(datasets.captures(name, N_SUBJECTS, N_REPETITIONS, seed=seed))
    recordings = [capture.recording for capture in captures]
    # Where there are two layers, the building blocks are the further one.
    truth = [
        next(iter(capture.layers.values()), capture.segments)
        if name == "step"
        else capture.segments
        for capture in captures
    ]
    return _make(name, "synthetic", recordings, truth)


def _make(
    name: str,
    source: str,
    recordings: Sequence[Recording],
    truth: Sequence[LabelledSegments],
    markers: str = "right_arm",
) -> SegmentedDataset:
    label = LabelConfig(markers=markers, longest_gap_s=_LONGEST_GAP_S)
    table = THESIS.get(name, THESIS["pick_and_place"])
    labelled = label.run(tuple(recordings), load_marker_set(markers))
    settings = {
        "locmin": {"window_s": table.windows_s[0]},
        "probs": {"window_s": table.windows_s[1]},
    }
    return SegmentedDataset(name, source, labelled, tuple(truth), table, settings)
