"""Demonstrations for the study of embodiment mapping: simulated throws, or labelled recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from besman.evaluation.recognition_data import dataset_folders, is_synthetic, name_parts
from besman.exceptions import ConfigError, MappingError
from besman.records import Failure, HandTrajectory, LabelledRecording, LabelledSegments
from besman.records.layers import IDLE, SIDES, Side, actions_of, building_blocks
from besman.stages.read.read_inputs import read_inputs
from besman.stages.select.stage import SelectConfig
from besman.synthetic.datasets import captures
from besman.work.outcome import Notes
from besman.work.work import Work

DATASET, CLASS, STICK = "stick_throw", "throw", "stick"
_LONGEST_S = 3600.0

Progress = Callable[[float], None]


@dataclass(frozen=True)
class DemonstrationSet:
    """All demonstrations of one class.

    Attributes
    ----------
    dataset : str
        Its folder's or its own name.
    source : str
        ``real`` or ``synthetic``.
    label : str
        The class.
    demonstrations : tuple of HandTrajectory
    failed : tuple of Failure
        Segments that are no demonstration, e.g. because of a gap.
    tool : str
        The robot's tool, where it has one of this name.
    free_spin : bool
        The rotation about the tool's axis does not matter.
    """

    dataset: str
    source: str
    label: str
    demonstrations: tuple[HandTrajectory, ...]
    failed: tuple[Failure, ...] = ()
    tool: str = "gripper"
    free_spin: bool = False

    @property
    def n(self) -> int:
        """Number of segments."""
        return len(self.demonstrations) + len(self.failed)


@dataclass
class _Collected:
    """What was taken out of recordings so far."""

    demonstrations: list[HandTrajectory] = field(default_factory=list)
    notes: Notes = field(default_factory=Notes)

    def take(
        self, stage: SelectConfig, recording: LabelledRecording, segments: LabelledSegments
    ) -> None:
        """Add the segments of a class of one recording."""
        n_before = len(self.notes.failures)
        try:
            found = stage.run((recording,), (segments,), work=Work(notes=self.notes))
        except MappingError:
            # Every segment of the recording failed: there may be others.
            if len(self.notes.failures) == n_before:
                raise
        else:
            self.demonstrations += found


def simulate_throw_set(
    n_subjects: int | None = None,
    n_repetitions: int | None = None,
    seed: int = 0,
    progress: Progress = lambda done: None,
) -> DemonstrationSet:
    """Simulate the stick throws of thesis 7.2.3 and cut them at their true borders.

    Parameters
    ----------
    n_subjects, n_repetitions, seed
        See `besman.synthetic.datasets.captures`; 697 throws of 7 people by default.
    progress : callable
        Gets the share done.
    """
    stage = SelectConfig(label=CLASS, object=STICK, greatest_duration_s=_LONGEST_S)
    collected = _Collected()
    for capture in captures(DATASET, n_subjects, n_repetitions, seed=seed, progress=progress):
        collected.take(stage, name_parts(capture.recording), capture.segments)
    return DemonstrationSet(
        DATASET,
        "synthetic",
        CLASS,
        tuple(collected.demonstrations),
        tuple(collected.notes.failures),
        tool="stick_holder",
        free_spin=True,
    )


def load_demonstrations(data: Path) -> list[DemonstrationSet]:
    """Read every labelled class of recordings; `IDLE` is no movement.

    Parameters
    ----------
    data : Path
        A folder of recordings with segments beside them, or a folder of such folders.

    Returns
    -------
    list of DemonstrationSet
        By folder and class. Building blocks of the left hand are taken from the left arm.

    Raises
    ------
    MappingError
        If nothing is labelled.
    RecordingError
        If a recording cannot be read.
    RecognitionError
        If a labelled recording has trajectories without names.
    """
    sets = [one for folder in dataset_folders(data) for one in _load_folder(folder)]
    if not sets:
        raise MappingError(
            f"{data}: no labelled segments; expected recordings with segments files beside them "
            "(STEM_manually_segmented.json)"
        )
    return sets


def _load_folder(folder: Path) -> list[DemonstrationSet]:
    """Read every labelled class of one folder's recordings."""
    inputs = read_inputs([str(folder)])
    pairs = [
        (name_parts(recording), truth)
        for recording, truth in zip(inputs.recordings, inputs.truth, strict=True)
        if truth is not None
    ]
    source = "synthetic" if is_synthetic(folder) else "real"
    layers = [
        (recording, side, segments)
        for recording, truth in pairs
        for side, segments in _layers(truth)
    ]
    classes = sorted(
        {(side, label) for _, side, part in layers for label in part.labels if label != IDLE}
    )
    names = [label for _, label in classes]
    found = []
    for side, label in sorted(classes, key=lambda pair: (SIDES.index(pair[0]), pair[1])):
        own = [(one, part) for one, own_side, part in layers if own_side == side]
        both = names.count(label) > 1
        found.append(_collect(folder.name, source, label, side, own, both))
    return found


def _layers(truth: LabelledSegments) -> Iterable[tuple[Side, LabelledSegments]]:
    """Return the segments that each arm is followed in."""
    if not truth.layers:
        return [("right", truth)]
    hands: list[tuple[Side, LabelledSegments]] = [
        (side, blocks)
        for side in SIDES
        if f"{side}_hand" in truth.layers and (blocks := building_blocks(truth, side)) is not None
    ]
    return hands or [("right", actions_of(truth))]


def _collect(
    dataset: str,
    source: str,
    label: str,
    side: Side,
    parts: list[tuple[LabelledRecording, LabelledSegments]],
    both_hands: bool,
) -> DemonstrationSet:
    """Take the segments of one class, of a throw with its target."""
    own = [(recording, part) for recording, part in parts if label in part.labels]
    throws = label == CLASS and all(STICK in recording.markers for recording, _ in own)
    stage = SelectConfig(
        label=label,
        arm=side,
        object=STICK if throws else None,
        greatest_duration_s=_LONGEST_S,
    )
    collected = _Collected()
    for recording, part in own:
        collected.take(stage, recording, part)
    return DemonstrationSet(
        dataset,
        source,
        f"{label} ({side})" if both_hands else label,
        tuple(collected.demonstrations),
        tuple(collected.notes.failures),
        tool="stick_holder" if throws else "gripper",
        free_spin=throws,
    )


def subject_of(name: str) -> str:
    """Return who made a demonstration: what its recording's name begins with.

    Parameters
    ----------
    name : str
        ``RECORDING:SEGMENT``; the recording is called ``SUBJECT_...``.
    """
    return Path(name.rpartition(":")[0]).stem.split("_")[0]


def choose_sets(
    data: Path | None,
    n_subjects: int | None = None,
    n_repetitions: int | None = None,
    seed: int = 0,
    progress: Progress = lambda done: None,
) -> list[DemonstrationSet]:
    """Read a folder's demonstrations, or simulate throws if no folder is given.

    Parameters
    ----------
    data : Path, optional
        See `load_demonstrations`.
    n_subjects, n_repetitions, seed, progress
        See `simulate_throw_set`.

    Raises
    ------
    ConfigError
        If a folder is given and subjects or repetitions too.
    """
    if data is None:
        return [simulate_throw_set(n_subjects, n_repetitions, seed, progress)]
    if n_subjects is not None or n_repetitions is not None:
        raise ConfigError(
            "--data and --subjects or --repetitions: got both; the latter are of simulated throws"
        )
    return load_demonstrations(data)
