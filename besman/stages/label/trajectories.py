"""From unnamed, broken trajectories to markers: naming, then filling of gaps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from besman.exceptions import LabellingError
from besman.geometry.gaps import BoolArray, fill_gaps
from besman.geometry.rigid_bodies import fill_members
from besman.person.marker_set import MarkerSet
from besman.records import Recording
from besman.records.frozen import hand_over
from besman.stages.label.fragments import split_fragments
from besman.stages.label.gather import NamedPaths, found_markers, gather_markers
from besman.stages.label.learning import learn_marker_model
from besman.stages.label.model import MarkerModel
from besman.stages.label.named_recording import NameDecision, NamedRecording
from besman.stages.label.naming import FREE, label_fragments
from besman.stages.label.presence import find_absence
from besman.stages.label.scores import GHOST

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_LEAST_TO_LEARN_S = 0.4


def learn_from_recording(teacher: Recording, marker_set: MarkerSet) -> MarkerModel:
    """Learn what a marker set looks like from a recording with names.

    Parameters
    ----------
    teacher : Recording
        Its trajectories carry the names of the set.
    marker_set : MarkerSet

    Returns
    -------
    MarkerModel
        Of the markers that the recording has.

    Raises
    ------
    LabellingError
        If a required marker is not there or never seen, a name is there twice, or the recording
        is too short to show how the markers move.
    """
    columns = marker_set.match(teacher.names, teacher.source)
    duration = len(teacher.time) / teacher.rate_hz
    if duration < _LEAST_TO_LEARN_S:
        raise LabellingError(
            f"{teacher.source}: {len(teacher.time)} frames ({duration:.3g} s) are too few to learn "
            f"markers from, expected at least {_LEAST_TO_LEARN_S:g} s"
        )
    positions = teacher.positions[:, list(columns.values())]
    seen: BoolArray = np.any(np.isfinite(positions).all(axis=2), axis=0)
    for marker, there in zip(columns, seen, strict=True):
        if marker in marker_set.required and not there:
            raise LabellingError(
                f"{teacher.source}: marker {marker!r} of {marker_set.name} is never seen, so "
                "nothing can be learnt of it"
            )
    markers = tuple(marker for marker, there in zip(columns, seen, strict=True) if there)
    bodies = (*marker_set.clusters.values(), *marker_set.objects.values())
    # A set that names no cluster does not say that there is none.
    return learn_marker_model(positions[:, seen], teacher.rate_hz, markers, bodies=bodies or None)


def name_trajectories(
    recording: Recording,
    marker_set: MarkerSet,
    model: MarkerModel,
    threshold: float,
    given: Mapping[str, int] | None = None,
) -> NamedRecording:
    """Name the trajectories of a recording.

    Parameters
    ----------
    recording, marker_set, model, threshold, given
        As of `decide_names`.

    Returns
    -------
    NamedRecording
        The markers found, in the order of the set, with all gaps.

    Raises
    ------
    LabellingError
        As `decide_names`.
    """
    decisions = decide_names(recording, marker_set, model, threshold, given)
    markers = found_markers(decisions, marker_set)
    return NamedRecording(
        time=recording.time,
        positions=hand_over(gather_markers(recording, decisions, markers)),
        markers=markers,
        filled=np.zeros((len(recording.time), len(markers)), dtype=np.bool_),
        rate_hz=recording.rate_hz,
        source=recording.source,
        first_frame=recording.first_frame,
        decisions=decisions,
        threshold=threshold,
    )


def decide_names(
    recording: Recording,
    marker_set: MarkerSet,
    model: MarkerModel,
    threshold: float,
    given: Mapping[str, int] | None = None,
) -> tuple[NameDecision, ...]:
    """Decide which marker each unbroken stretch of a recording's trajectories is.

    Parameters
    ----------
    recording : Recording
        Broken trajectories.
    marker_set : MarkerSet
    model : MarkerModel
        Statistics of its markers.
    threshold : float
        Least confidence of a name that is given.
    given : mapping of str to int, optional
        Trajectory of each marker whose name is taken from the recording; other trajectories with
        a name then are no markers, and those without get what names are left. If not given, the
        recording's names are not looked at.

    Returns
    -------
    tuple of NameDecision
        In the order of their first frames.

    Raises
    ------
    LabellingError
        If nothing is seen, or the marker set does not fit the recording.
    """
    fragments = split_fragments(recording.positions, recording.rate_hz)
    if not fragments.n_fragments:
        raise LabellingError(
            f"{recording.source}: nothing to name: no marker is seen in any of "
            f"{fragments.n_frames} frames"
        )
    known = None if given is None else _known_labels(recording, fragments.column, model, given)
    answer = label_fragments(fragments, model, known=known, threshold=threshold)
    owners = {column: marker for marker, column in (given or {}).items()}
    decisions = []
    for k, label in enumerate(answer.labels):
        column = int(fragments.column[k])
        guess = "" if answer.best[k] == GHOST else model.markers[answer.best[k]]
        decisions.append(
            NameDecision(
                column,
                int(fragments.start[k]),
                int(fragments.stop[k]),
                owners.get(column, guess),
                round(float(answer.confidence[k]), 4),
                bool(label != GHOST or column in owners),
            )
        )
    markers = found_markers(decisions, marker_set)
    paths = NamedPaths(recording, decisions, markers)
    _refuse_misfit(recording, marker_set, model, paths, tuple(given or ()))
    return tuple(decisions)


def _known_labels(
    recording: Recording, columns: IntArray, model: MarkerModel, given: Mapping[str, int]
) -> IntArray:
    """Return what the recording's names say of each fragment; see `label_fragments`."""
    of_column = np.array([FREE if name is None else GHOST for name in recording.names])
    for marker, column in given.items():
        # Of a marker that the model has not, the name is all that is known.
        of_column[column] = model.markers.index(marker) if marker in model.markers else GHOST
    return of_column[columns]


def _refuse_misfit(
    recording: Recording,
    marker_set: MarkerSet,
    model: MarkerModel,
    paths: Mapping[str, FloatArray],
    given: tuple[str, ...],
) -> None:
    """Raise an error if what was found cannot be the body of the marker set."""
    reason = find_absence(paths, marker_set, model, recording.rate_hz, given)
    if reason is not None:
        raise LabellingError(
            f"{recording.source}: marker set {marker_set.name} does not fit, nothing is named: "
            f"{reason}, among {len(recording.names)} trajectories; expected those of this "
            "person's markers, see --markers and learn_from"
        )


def fill_markers(
    positions: FloatArray,
    markers: tuple[str, ...],
    marker_set: MarkerSet,
    longest: int,
    longest_rigid: int,
) -> tuple[FloatArray, BoolArray]:
    """Fill gaps: rigid clusters from their own markers, then all others by a spline.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Metres; NaN where not seen.
    markers : tuple of str, length M
    marker_set : MarkerSet
        Its clusters are the rigid bodies.
    longest, longest_rigid : int
        Greatest number of samples to fill at a stretch by a spline, and from a cluster.

    Returns
    -------
    positions : array, shape (T, M, 3)
    filled : bool array, shape (T, M)
    """
    result = positions.copy()
    return result, fill_in_place(result, markers, marker_set, longest, longest_rigid)


def fill_in_place(
    positions: FloatArray,
    markers: tuple[str, ...],
    marker_set: MarkerSet,
    longest: int,
    longest_rigid: int,
) -> BoolArray:
    """Fill gaps as `fill_markers` does, in the array given; return which samples were filled."""
    filled = np.zeros(positions.shape[:2], dtype=np.bool_)

    def fill_clusters() -> None:
        for cluster in marker_set.clusters.values():
            member = [markers.index(marker) for marker in cluster if marker in markers]
            filled[:, member] |= fill_members(positions, member, longest_rigid)

    fill_clusters()
    for k in range(len(markers)):
        positions[:, k], splined = fill_gaps(positions[:, k], longest)
        filled[:, k] |= splined
    # A mate's own short gap no longer stands in the way.
    fill_clusters()
    return filled
