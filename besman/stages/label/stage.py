"""Stages: from a recording's trajectories to the markers of a set, and their figures."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from besman.config.stage import Items, Stage, Truth, Work
from besman.exceptions import LabellingError, see_look
from besman.geometry.gaps import find_runs
from besman.person.marker_set import MarkerSet
from besman.person.mirror import MIRROR, MIRROR_TURN, mirror_recording
from besman.records import FloatArray, LabelledRecording, Recording
from besman.records.frozen import hand_over
from besman.stages.label.derive_markers import derive_markers, mend_hands
from besman.stages.label.joined_trajectories import WovenRecording
from besman.stages.label.model import MarkerModel
from besman.stages.label.model_from_pose import model_from_pose
from besman.stages.label.named_recording import NamedRecording
from besman.stages.label.person_check import check_person
from besman.stages.label.results import label_results
from besman.stages.label.trajectories import (
    fill_in_place,
    fill_markers,
    learn_from_recording,
    name_trajectories,
)


class LabelBase(Stage):
    """What all methods have, count and tell.

    Attributes
    ----------
    markers : str
        A marker set of ``configs/markers`` or the path of one.
    longest_gap_s : float
        Gaps up to this length are filled by a spline. A longer one is an error in a required
        marker, and stays a gap in an optional one.
    longest_rigid_gap_s : float
        Gaps up to this length are filled from the other markers of a rigid cluster.
    leave_out : bool
        A recording that cannot be used, as its markers are hidden for too long or on no person, is
        left out with a warning, if others can be used. Otherwise it ends the run.
    """

    markers: str = "right_arm"
    longest_gap_s: float = Field(default=0.25, ge=0.0)
    longest_rigid_gap_s: float = Field(default=1.0, ge=0.0)
    leave_out: bool = False

    looks_at_names: ClassVar[bool] = True
    """Whether names that trajectories carry count."""

    def items(self, recordings: tuple[Recording, ...], *others: Any) -> Items:
        """Count the recordings."""
        return Items(len(recordings), "recordings")

    def figures(
        self,
        labelled: tuple[LabelledRecording, ...],
        truth: Truth,
        recordings: tuple[Recording, ...],
        marker_set: MarkerSet,
        *others: Any,
    ) -> dict[str, Any]:
        """Return what was named, and how much of it right; see `label_results`."""
        return label_results(
            recordings, labelled, marker_set, truth.names, looks_at_names=self.looks_at_names
        )

    @abstractmethod
    def take_given(
        self, recording: Recording, marker_set: MarkerSet, teacher: Recording | None = None
    ) -> LabelledRecording | None:
        """Take a recording's own names for markers, if these are all that is needed.

        Parameters
        ----------
        recording, marker_set, teacher
            As of ``run``.

        Returns
        -------
        LabelledRecording or None
            None where names have to be found.

        Raises
        ------
        LabellingError
            If that cannot help: a required marker is missing or hidden for too long.
        """

    def fill_samples(self, rate_hz: float) -> tuple[int, int]:
        """Return how many samples at a stretch are filled by a spline, and from a cluster."""
        # A length in seconds that is a whole number of samples must not lose one to rounding.
        return (
            int(np.floor(self.longest_gap_s * rate_hz + 1e-6)),
            int(np.floor(self.longest_rigid_gap_s * rate_hz + 1e-6)),
        )

    def take_names(
        self,
        recording: Recording | WovenRecording,
        columns: dict[str, int],
        marker_set: MarkerSet,
    ) -> LabelledRecording:
        """Take trajectories for markers as they are named, and fill the gaps that may be filled."""
        chosen = tuple(columns.values())
        orientations = _keep_orientations(recording, chosen)
        if marker_set.side != "left":
            positions = recording.gather_to_fill(chosen)
        else:
            # In place: of an hour there are hundreds of megabytes.
            positions = recording.gather(chosen)
            positions *= MIRROR
            orientations = None if orientations is None else orientations * MIRROR_TURN
        positions = mend_hands(positions, tuple(columns), marker_set, recording)
        filled = fill_in_place(
            positions, tuple(columns), marker_set, *self.fill_samples(recording.rate_hz)
        )
        taken = LabelledRecording(
            time=recording.time,
            positions=hand_over(positions),
            markers=tuple(columns),
            filled=filled,
            rate_hz=recording.rate_hz,
            source=recording.source,
            first_frame=recording.first_frame,
            orientations=orientations,
        )
        return derive_markers(taken, marker_set)

    def refuse_gaps(self, labelled: LabelledRecording, marker_set: MarkerSet) -> None:
        """Raise a LabellingError if a required marker still has a gap."""
        for marker in marker_set.required:
            _refuse_gap(labelled.marker(marker), marker, labelled, self.longest_gap_s)


class LabelConfig(LabelBase):
    """Take named trajectories for markers and fill short gaps.

    Attributes
    ----------
    method : "named"
        Trajectories carry names.
    markers, longest_gap_s, longest_rigid_gap_s, leave_out
        As in `LabelBase`.
    """

    method: Literal["named"] = "named"

    def run(
        self,
        recordings: tuple[Recording, ...],
        marker_set: MarkerSet,
        teacher: Recording | None = None,
        work: Work = Work(),
    ) -> tuple[LabelledRecording, ...]:
        """Label recordings.

        Parameters
        ----------
        recordings : tuple of Recording
        marker_set : MarkerSet
            What `markers` names.
        teacher : Recording, optional
            Not looked at: names need not be learnt.
        work : Work

        Returns
        -------
        tuple of LabelledRecording
            Markers in the order of the set; trajectories that are no marker are left out.

        Raises
        ------
        LabellingError
            If a required marker is not there or has a gap that is too long.
        """
        labelled = []
        for number, recording in enumerate(recordings, start=1):
            labelled.append(self.take_given(recording, marker_set))
            work.progress(number / len(recordings))
        return tuple(labelled)

    def take_given(
        self,
        recording: Recording | WovenRecording,
        marker_set: MarkerSet,
        teacher: Recording | None = None,
    ) -> LabelledRecording:
        """Take a recording's own names for markers."""
        columns = marker_set.match(recording.names, recording.source)
        labelled = self.take_names(recording, columns, marker_set)
        self.refuse_gaps(labelled, marker_set)
        check_person(labelled, marker_set)
        return labelled


def _keep_orientations(
    recording: Recording | WovenRecording, columns: tuple[int, ...]
) -> FloatArray | None:
    """Return the orientations of the trajectories that are kept, shape (T, M, 4), if there are."""
    if recording.orientations is None:
        return None
    kept: FloatArray = recording.orientations[:, columns]
    # Markers that stand among bodies have none.
    return kept if np.isfinite(kept).any() else None


def _refuse_gap(
    positions: FloatArray, marker: str, recording: LabelledRecording, longest_gap_s: float
) -> None:
    """Raise an error if a required marker still has a gap."""
    runs = find_runs(np.isnan(positions[:, 0]))
    if len(runs) == 0:
        return
    start, end = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    first, last = recording.first_frame + start, recording.first_frame + end - 1
    raise LabellingError(
        f"{recording.source}: marker {marker!r} is not seen in frames {first} to {last} "
        f"({(end - start) / recording.rate_hz:.3g} s); gaps up to longest_gap_s = "
        f"{longest_gap_s:g} s are filled, those of back and hand up to longest_rigid_gap_s from "
        "their other two markers"
    )


class NamingBase(LabelBase):
    """What methods have that find names.

    Attributes
    ----------
    learn_from : str, optional
        A recording with names, from which the distances of the markers are learnt; relative to
        the pipeline's file. Without it the marker set's own pose is used.
    threshold : float
        A name less sure than this is not given, and is listed for review.
    """

    learn_from: str | None = None
    threshold: float = Field(default=0.8, gt=0.5, lt=1.0)

    def learn(self, marker_set: MarkerSet, teacher: Recording | None = None) -> MarkerModel:
        """Return the model of the markers: from the teacher, or from the set's own pose."""
        if teacher is not None and marker_set.side == "left":
            teacher = mirror_recording(teacher)
        if teacher is not None:
            return learn_from_recording(teacher, marker_set)
        return model_from_pose(marker_set)

    def fill(self, named: NamedRecording, marker_set: MarkerSet) -> NamedRecording:
        """Fill the gaps that are not too long."""
        positions, filled = fill_markers(
            named.positions, named.markers, marker_set, *self.fill_samples(named.rate_hz)
        )
        return replace(named, positions=positions, filled=filled)

    def find_names(
        self,
        recording: Recording,
        marker_set: MarkerSet,
        model: MarkerModel,
        given: dict[str, int] | None = None,
    ) -> NamedRecording:
        """Name what has no name, and fill gaps; see `name_trajectories`.

        Raises
        ------
        LabellingError
            If the marker set does not fit, or a required marker is not found or has a gap that
            is too long.
        """
        if marker_set.side == "left":
            recording = mirror_recording(recording)
        found = name_trajectories(recording, marker_set, model, self.threshold, given)
        named = self.fill(found, marker_set)
        for marker in marker_set.required:
            if marker not in named.markers:
                raise LabellingError(
                    f"{recording.source}: marker {marker!r} of {marker_set.name} was not found "
                    f"with confidence {self.threshold:g}; found: {', '.join(named.markers)}"
                    + see_look(recording.source)
                )
        self.refuse_gaps(named, marker_set)
        named = derive_markers(named, marker_set)
        check_person(named, marker_set)
        return named


class LabelTrajectoriesConfig(NamingBase):
    """Name unnamed, broken trajectories, and fill gaps.

    Attributes
    ----------
    method : "trajectories"
        Trajectories carry no names, or none that are trusted.
    markers, longest_gap_s, longest_rigid_gap_s, leave_out
        As in `LabelBase`.
    learn_from, threshold
        As in `NamingBase`.
    """

    method: Literal["trajectories"] = "trajectories"

    looks_at_names: ClassVar[bool] = False

    def run(
        self,
        recordings: tuple[Recording, ...],
        marker_set: MarkerSet,
        teacher: Recording | None = None,
        work: Work = Work(),
    ) -> tuple[NamedRecording, ...]:
        """Label recordings.

        Parameters
        ----------
        recordings : tuple of Recording
        marker_set : MarkerSet
            What `markers` names.
        teacher : Recording, optional
            What `learn_from` names.
        work : Work

        Returns
        -------
        tuple of NamedRecording
            Markers in the order of the set.

        Raises
        ------
        LabellingError
            As `find_names`.
        """
        model = self.learn(marker_set, teacher)
        labelled = []
        for number, recording in enumerate(recordings, start=1):
            labelled.append(self.find_names(recording, marker_set, model))
            work.progress(number / len(recordings))
        return tuple(labelled)

    def take_given(
        self, recording: Recording, marker_set: MarkerSet, teacher: Recording | None = None
    ) -> None:
        """Take no name that a recording has."""
