"""Recordings for the labelling experiment, and what is learnt from which of them."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.exceptions import LabellingError, RecordingError
from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import read_recording
from besman.io.recordings.true_names import find_true_names
from besman.person.marker_set import load_marker_set, normalise_name
from besman.stages.label.learning import learn_marker_model
from besman.stages.label.model import MarkerModel

FloatArray = npt.NDArray[np.float64]

_PERSON = re.compile(r"(subject|person|participant)[_-]?\d+", re.IGNORECASE)
_LEAST_MARKERS = 4
_LEARNT_SHARE = 0.2


@dataclass(frozen=True, eq=False)
class ExperimentTake:
    """A recording of the experiment.

    Attributes
    ----------
    source : str
        File name.
    person : str
        Who moves.
    positions : array, shape (T, M, 3)
        Metres, NaN where not seen.
    rate_hz : float
    markers : tuple of str, length M
        Names; empty if the recording has none.
    synthetic : bool
    """

    source: str
    person: str
    positions: FloatArray
    rate_hz: float
    markers: tuple[str, ...]
    synthetic: bool


@dataclass(frozen=True, eq=False)
class Protocol:
    """Recordings to be named, and what is known of the markers.

    Attributes
    ----------
    dataset : str
        Name of the folder.
    learnt_from : str
        Of whom the model is: ``same person``, ``other person``, ``same recording``.
    model : MarkerModel
    takes : tuple of ExperimentTake
    """

    dataset: str
    learnt_from: str
    model: MarkerModel
    takes: tuple[ExperimentTake, ...]


def make_protocols(folder: Path, synthetic: bool = False) -> list[Protocol]:
    """Read a folder and its subfolders, and say which recordings teach and which are named.

    With several recordings of a person the first teaches the others; with several persons the
    first recording of one also teaches all of the next; a single recording teaches with its first
    fifth. Recordings without names are named by the first that has some.

    Parameters
    ----------
    folder : Path
    synthetic : bool
        Whether the recordings are known to be synthetic.

    Returns
    -------
    list of Protocol

    Raises
    ------
    RecordingError, LabellingError
        If there is no folder, or no recording with names.
    """
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder; expected one with recordings (--data)")
    protocols = []
    for place in [folder, *sorted(path for path in folder.iterdir() if path.is_dir())]:
        takes = _read_takes(place, synthetic)
        if takes:
            protocols += _plan(place.resolve().name, takes)
    if not protocols:
        raise LabellingError(
            f"{folder}: no recording with names here or one folder below; expected some whose "
            "names can be taken away and found again"
        )
    return protocols


def _read_takes(folder: Path, synthetic: bool) -> list[ExperimentTake]:
    """Read the recordings of one folder; those with names get the markers they share."""
    try:
        files = find_recordings([folder])
    except RecordingError:
        return []
    recordings = [read_recording(file) for file in files]
    named = [recording for recording in recordings if any(recording.names)]
    names = [{normalise_name(n): n for n in recording.names if n} for recording in named]
    shared = tuple(sorted(set.intersection(*map(set, names)))) if names else ()
    if len(shared) < _LEAST_MARKERS:
        return []
    takes = []
    for file, recording in zip(files, recordings, strict=True):
        person = _PERSON.search(file.stem)
        positions = recording.positions
        markers: tuple[str, ...] = ()
        if any(recording.names):
            markers = tuple(names[0][name] for name in shared)
            place = [normalise_name(name or "") for name in recording.names]
            positions = positions[:, [place.index(name) for name in shared]]
        takes.append(
            ExperimentTake(
                recording.source,
                person.group().lower() if person else file.stem,
                positions,
                recording.rate_hz,
                markers,
                synthetic or find_true_names(file) is not None,
            )
        )
    return takes


def _plan(dataset: str, takes: list[ExperimentTake]) -> list[Protocol]:
    """Say who teaches whom."""
    persons: dict[str, list[ExperimentTake]] = {}
    for take in takes:
        if take.markers:
            persons.setdefault(take.person, []).append(take)
    groups = list(persons.values())
    own = [Protocol(dataset, "same person", _learn(g[0]), tuple(g[1:])) for g in groups if g[1:]]
    other = [
        Protocol(dataset, "other person", _learn(groups[k - 1][0]), tuple(group))
        for k, group in enumerate(groups)
        if len(groups) > 1
    ]
    plans = own + other
    if not plans:
        take = groups[0][0]
        cut = round(_LEARNT_SHARE * len(take.positions))
        rest = _part(take, slice(cut, None))
        plans = [Protocol(dataset, "same recording", _learn(_part(take, slice(cut))), (rest,))]
    unnamed = tuple(take for take in takes if not take.markers)
    if unnamed:
        plans.append(Protocol(dataset, "other person", _learn(groups[0][0]), unnamed))
    return plans


def _learn(take: ExperimentTake) -> MarkerModel:
    """Learn a model; what is stuck to one body is known for markers of one arm."""
    arm = load_marker_set("right_arm")
    bodies = None
    spelling = {_canonical(name): name for name in take.markers}
    if set(arm.required) <= set(spelling):
        groups = (*arm.clusters.values(), *arm.objects.values())
        bodies = tuple(tuple(spelling.get(name, name) for name in group) for group in groups)
    return learn_marker_model(take.positions, take.rate_hz, take.markers, bodies=bodies)


def _canonical(name: str) -> str:
    """Return a marker's canonical spelling."""
    return re.sub(r"[\s-]+", "_", name.strip().lower())


def _part(take: ExperimentTake, frames: slice) -> ExperimentTake:
    """Return some frames of a recording."""
    return replace(take, positions=take.positions[frames])
