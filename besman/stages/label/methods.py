"""All labelling methods under one key: ``label: {method: ...}``."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from besman.config.stage import Work
from besman.person.marker_set import MarkerSet
from besman.records import LabelledRecording, Recording
from besman.stages.label.model import MarkerModel
from besman.stages.label.person_check import check_person
from besman.stages.label.stage import LabelConfig, LabelTrajectoriesConfig, NamingBase


class LabelAutoConfig(NamingBase):
    """Take names that recordings carry, name what has none, and fill gaps.

    A recording whose names make up the marker set is taken as it is. Where some of its markers are
    missing or hidden and there are trajectories without names, these are named with the others as
    they are called. Where no name fits, all trajectories are named, whatever they are called.

    Attributes
    ----------
    method : "auto"
        Each recording says itself which of its trajectories have names.
    markers, longest_gap_s, longest_rigid_gap_s, leave_out
        As in `LabelBase`.
    learn_from, threshold
        As in `NamingBase`.
    """

    method: Literal["auto"] = "auto"

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
            What `learn_from` names; not looked at where no name has to be found.
        work : Work

        Returns
        -------
        tuple of LabelledRecording
            Markers in the order of the set; a NamedRecording where names were found.

        Raises
        ------
        LabellingError
            If a required marker is not there, is not found, or has a gap that is too long; or if
            two trajectories have the name of one marker.
        """

        @cache
        def learn() -> MarkerModel:
            return self.learn(marker_set, teacher)

        labelled = []
        for number, recording in enumerate(recordings, start=1):
            taken = self.take_given(recording, marker_set, teacher)
            if taken is None:
                given = marker_set.find(recording.names, recording.source)
                taken = self.find_names(recording, marker_set, learn(), given or None)
            labelled.append(taken)
            work.progress(number / len(recordings))
        return tuple(labelled)

    def take_given(
        self, recording: Recording, marker_set: MarkerSet, teacher: Recording | None = None
    ) -> LabelledRecording | None:
        """Take a recording's own names for markers, if these are all that is needed."""
        given = marker_set.find(recording.names, recording.source)
        if not given:
            return None
        nameless = any(name is None for name in recording.names)
        if not nameless:
            marker_set.match(recording.names, recording.source)
        taken = self.take_names(recording, given, marker_set)
        if nameless and self._lacks(taken, marker_set, teacher):
            return None
        self.refuse_gaps(taken, marker_set)
        check_person(taken, marker_set)
        return taken

    def _lacks(
        self, taken: LabelledRecording, marker_set: MarkerSet, teacher: Recording | None
    ) -> bool:
        """Tell whether a marker may be among the trajectories without names."""
        findable = set(marker_set.pose_m)
        if teacher is not None:
            findable = set(marker_set.find(teacher.names, teacher.source))
        if not findable | set(marker_set.required) <= set(taken.markers):
            return True
        return any(np.isnan(taken.marker(marker)).any() for marker in marker_set.required)


LabelMethod = LabelAutoConfig | LabelConfig | LabelTrajectoriesConfig
DefaultLabelConfig = LabelAutoConfig


def _default_method(value: Any) -> Any:
    """Take the default method where none is named."""
    if isinstance(value, dict) and "method" not in value:
        return {"method": "auto", **value}
    return value


LabelStage = Annotated[LabelMethod, Field(discriminator="method"), BeforeValidator(_default_method)]
