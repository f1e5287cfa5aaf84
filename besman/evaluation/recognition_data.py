"""Labelled segments of whole datasets, for the experiments of thesis chapter 5."""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecognitionError
from besman.inputs import read_inputs
from besman.io.recordings import find_recordings
from besman.labelling.gaps import fill_gaps
from besman.recognition.examples import Candidate, find_candidates
from besman.recognition.features import count_channels
from besman.recognition.model import Recipe
from besman.recognition.stage import RecognizeConfig
from besman.records import LabelledRecording, Recording
from besman.resources import resource_folder

FloatArray = npt.NDArray[np.float64]

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


def load_sets(data: Path | None) -> list[LabelledSet]:
    """Read datasets.

    Parameters
    ----------
    data : Path, optional
        A folder of recordings with segments beside them, or a folder of such folders; the embedded
        synthetic sample if not given.

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
    root = resource_folder("data") / "stick_throw" if data is None else data
    inside = sorted(path for path in root.iterdir() if path.is_dir()) if root.is_dir() else []
    folders = [folder for folder in inside if any(folder.glob("*_manually_segmented.json"))]
    return [_load_set(folder) for folder in folders or [root]]


def _load_set(folder: Path) -> LabelledSet:
    import time

    files = find_recordings([folder])
    beside = [file.with_name(file.stem + end) for file in files for end in _MADE_BY_SYNTH]
    made = data_is_embedded(folder) or any(path.exists() for path in beside)
    inputs = read_inputs([str(folder)])
    recordings = [_fill(name_parts(recording)) for recording in inputs.recordings]
    truth = [segments for segments in inputs.truth if segments is not None]
    stage = RecognizeConfig()
    candidates = find_candidates(recordings, truth, stage.idle_s, stage.idle_speed_m_s)
    n_all = len(find_candidates(recordings, truth, stage.idle_s, np.inf))
    if not candidates:
        raise RecognitionError(f"{folder}: no labelled segments; expected segments files")
    lengths = [one.bounds[1] - one.bounds[0] for one in candidates]
    recipe = stage.make_recipe([one.recording for one in candidates], lengths)
    started = time.perf_counter()
    values = _extract(candidates, recipe)
    return LabelledSet(
        folder.name,
        "synthetic" if made else "real",
        recipe,
        values,
        np.array([one.label for one in candidates]),
        np.array([Path(one.recording.source).stem.split("_")[0] for one in candidates]),
        time.perf_counter() - started,
        n_all - len(candidates),
    )


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


def _fill(recording: LabelledRecording) -> LabelledRecording:
    """Fill short gaps."""
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
