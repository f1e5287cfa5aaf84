"""Labelled segments of whole datasets, for the experiments of thesis chapter 5."""

from __future__ import annotations

import re
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.classifiers.draw_examples import Candidate
from besman.config.resources import resource_folder
from besman.exceptions import ConfigError, RecognitionError, nearest
from besman.geometry.gaps import fill_gaps
from besman.io.recordings.folders import find_recordings
from besman.records import LabelledRecording, LabelledSegments, Recording
from besman.records.layers import IDLE
from besman.stages.read.read_inputs import read_inputs
from besman.stages.recognize.examples import find_candidates
from besman.stages.recognize.features import count_channels
from besman.stages.recognize.model import Recipe
from besman.stages.recognize.stage import RecognizeConfig
from besman.synthetic.datasets import captures

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[float], None]

SIMULATED = ("pick_and_place", "lever", "ball_throw", "stick_throw", "gestures")
"""Datasets of thesis chapter 5."""

# Eleven classes in the thesis: what is between two gestures is none of them.
_WITHOUT_REST = ("gestures",)

LONGEST_GAP_S = 0.5
"""Gaps up to this length are filled, seconds."""

_MADE_BY_SYNTH = ("_truth.json", "_hands.npz")


@dataclass(frozen=True, eq=False)
class LabelledSet:
    """All labelled segments of a dataset and their features.

    Attributes
    ----------
    name : str
        Its folder.
    source : str
        ``real`` or ``synthetic``.
    recipe : Recipe
        How features were made.
    values : array, shape (N, P, C)
        Features.
    labels : str array, shape (N,)
    subjects : str array, shape (N,)
        What the recording's name begins with, up to the first underscore.
    extract_s : float
        Seconds that the features took.
    n_left_out : int
        Stretches without a label in which the hand moves: neither rest nor a known movement.
    """

    name: str
    source: str
    recipe: Recipe
    values: FloatArray
    labels: npt.NDArray[np.str_]
    subjects: npt.NDArray[np.str_]
    extract_s: float
    n_left_out: int = 0

    def without_objects(self) -> LabelledSet:
        """Return the same without the features of objects."""
        keep = ~self.recipe.object_channels
        return replace(self, recipe=self.recipe.without_objects(), values=self.values[:, :, keep])

    @property
    def widths(self) -> tuple[int, ...]:
        """Channels of each feature."""
        return count_channels(self.recipe.features, self.recipe.markers)


def load_sets(data: Path) -> list[LabelledSet]:
    """Read datasets.

    Parameters
    ----------
    data : Path
        A folder of recordings with segments beside them, or a folder of such folders.

    Returns
    -------
    list of LabelledSet

    Raises
    ------
    RecognitionError
        If nothing is labelled.
    RecordingError
        If a recording cannot be read.
    """
    return [_load_set(folder) for folder in dataset_folders(data)]


def dataset_folders(data: Path) -> list[Path]:
    """Return the folders in a folder that hold segments files; the folder itself if none does."""
    inside = sorted(path for path in data.iterdir() if path.is_dir()) if data.is_dir() else []
    folders = [folder for folder in inside if any(folder.glob("*_manually_segmented.json"))]
    return folders or [data]


def simulate_sets(
    names: Sequence[str] | None = None,
    n_subjects: int | None = None,
    n_repetitions: int | None = None,
    seed: int = 0,
    progress: Progress = lambda done: None,
) -> list[LabelledSet]:
    """Simulate datasets, by default those of thesis chapter 5 and of the size they have there.

    Parameters
    ----------
    names : sequence of str, optional
        Some of `SIMULATED`; all if not given.
    n_subjects, n_repetitions, seed
        See `besman.synthetic.datasets.captures`.
    progress : callable
        Gets the share done.

    Returns
    -------
    list of LabelledSet

    Raises
    ------
    ConfigError
        If there is no such dataset.
    """
    chosen = tuple(names or SIMULATED)
    for name in chosen:
        if name not in SIMULATED:
            raise ConfigError(f"--dataset: no dataset {name!r}; {nearest(name, SIMULATED)}")
    sets = []
    for index, name in enumerate(chosen):

        def report(done: float, index: int = index) -> None:
            progress((index + done) / len(chosen))

        made = list(captures(name, n_subjects, n_repetitions, seed=seed, progress=report))
        recordings = [name_parts(capture.recording) for capture in made]
        truth = [capture.segments for capture in made]
        idle_s = RecognizeConfig().idle_s
        if name in _WITHOUT_REST:
            truth, idle_s = [_without_rest(segments) for segments in truth], np.inf
        sets.append(_make_set(name, "synthetic", recordings, truth, idle_s))
    return sets


def _without_rest(segments: LabelledSegments) -> LabelledSegments:
    return segments.take([row for row, label in enumerate(segments.labels) if label != IDLE])


def _load_set(folder: Path) -> LabelledSet:
    inputs = read_inputs([str(folder)])
    recordings = [bridge_gaps(name_parts(recording)) for recording in inputs.recordings]
    truth = [segments for segments in inputs.truth if segments is not None]
    source = "synthetic" if is_synthetic(folder) else "real"
    return _make_set(folder.name, source, recordings, truth, RecognizeConfig().idle_s)


def _make_set(
    name: str,
    source: str,
    recordings: Sequence[LabelledRecording],
    truth: Sequence[LabelledSegments],
    idle_s: float,
) -> LabelledSet:
    """Compute the features of all labelled segments."""
    stage = RecognizeConfig()
    candidates = find_candidates(recordings, truth, idle_s, stage.idle_speed_m_s)
    n_all = len(find_candidates(recordings, truth, idle_s, np.inf))
    if not candidates:
        raise RecognitionError(f"{name}: no labelled segments; expected segments files")
    lengths = [one.bounds[1] - one.bounds[0] for one in candidates]
    recipe = stage.make_recipe([one.recording for one in candidates], lengths)
    started = time.perf_counter()
    values = _extract(candidates, recipe)
    return LabelledSet(
        name,
        source,
        recipe,
        values,
        np.array([one.label for one in candidates]),
        np.array([Path(one.recording.source).stem.split("_")[0] for one in candidates]),
        time.perf_counter() - started,
        n_all - len(candidates),
    )


def is_synthetic(folder: Path) -> bool:
    """Tell whether a folder's recordings were simulated: embedded, or written by `besman synth`."""
    files = find_recordings([folder])
    beside = [file.with_name(file.stem + end) for file in files for end in _MADE_BY_SYNTH]
    return data_is_embedded(folder) or any(path.exists() for path in beside)


def data_is_embedded(folder: Path) -> bool:
    """Tell whether a folder is part of what besman brings along, all of which is synthetic."""
    return folder.resolve().is_relative_to(resource_folder("data").resolve())


def name_parts(recording: Recording) -> LabelledRecording:
    """Take names as those of markers: ``Hand top`` is hand_top, ``RightForeArm`` right_fore_arm.

    Raises
    ------
    RecognitionError
        If a trajectory has no name.
    """
    names = [re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name or "") for name in recording.names]
    if "" in names:
        raise RecognitionError(f"{recording.source}: trajectory {names.index('') + 1} has no name")
    return LabelledRecording(
        recording.time,
        recording.positions,
        tuple(name.strip().lower().replace(" ", "_") for name in names),
        np.zeros(recording.positions.shape[:2], dtype=bool),
        recording.rate_hz,
        recording.source,
        recording.first_frame,
        recording.orientations,
    )


def bridge_gaps(recording: LabelledRecording) -> LabelledRecording:
    """Fill gaps up to `LONGEST_GAP_S`."""
    if np.isfinite(recording.positions).all():
        return recording
    longest = round(LONGEST_GAP_S * recording.rate_hz)
    filled = [
        fill_gaps(recording.positions[:, k], longest)[0] for k in range(len(recording.markers))
    ]
    return replace(recording, positions=np.stack(filled, axis=1))


def _extract(candidates: list[Candidate], recipe: Recipe) -> FloatArray:
    """Compute features, recording by recording, in the order of the candidates."""
    rows = defaultdict(list)
    for index, one in enumerate(candidates):
        rows[one.recording.source].append(index)
    parts = [
        recipe.extract(candidates[own[0]].recording, [candidates[k].bounds for k in own])
        for own in rows.values()
    ]
    values = np.concatenate(parts)
    order = np.argsort(np.concatenate(list(rows.values())))
    return np.asarray(values[order])
