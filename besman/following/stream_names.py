"""Frames of unnamed points as frames of named markers, while they come."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from besman.live.stream import StreamFormat
from besman.person.marker_set import MarkerSet
from besman.person.mirror import mirror_name, mirror_positions
from besman.records import FloatArray
from besman.stages.label.model import MarkerModel
from besman.stages.label.online import NameChange, OnlineNaming
from besman.stages.label.presence import find_absence
from besman.stages.label.scores import GHOST

# What was said of the last so many seconds is corrected; what lies before stays as it was said.
LOOK_BACK_S = 0.5


LearnNames = Callable[[MarkerSet], MarkerModel]
"""Returns what the markers of a set look like."""


def needs_names(stream: StreamFormat, marker_set: MarkerSet) -> bool:
    """Tell whether a stream's points have to be named: required ones lack a name."""
    own = marker_set.find(stream.names, stream.source)
    return None in stream.names and not own.keys() >= set(marker_set.required)


class StreamNames:
    """Names the points of a stream.

    Parameters
    ----------
    stream : StreamFormat
        Its names are not looked at.
    marker_set : MarkerSet
    model : MarkerModel
        What its markers look like.

    Attributes
    ----------
    format : StreamFormat
        Of what `take` returns: the markers of the model.
    waits_for : str
        Why no frame could be named until now.
    """

    def __init__(self, stream: StreamFormat, marker_set: MarkerSet, model: MarkerModel) -> None:
        # As a left-handed person wears them: what reads the format turns them round again.
        worn = map(mirror_name, model.markers) if marker_set.side == "left" else model.markers
        self.format = replace(stream, names=tuple(worn))
        self.waits_for = "markers are told by their distances"
        self._set, self._model = marker_set, model
        self._required = np.array([model.markers.index(name) for name in marker_set.required])
        self._n_columns = len(stream.names)
        self._checked = False
        self._begin()

    def take(self, positions: FloatArray) -> tuple[FloatArray | None, list[dict[str, Any]]]:
        """Take a frame, shape (C, 3), metres; NaN where nothing was seen.

        Returns
        -------
        named : array, shape (M, 3), or None
            The markers of `format`, NaN where not seen; None before a person was found.
        changes : list of dict
            What is to be told of names: those that are new, and those that were wrong.
        """
        naming = self._naming
        # Distances tell a left-handed person from a right-handed one in a mirror by sides alone.
        is_left = self._set.side == "left"
        changes = naming.take(mirror_positions(positions) if is_left else positions)
        if not naming.has_begun:
            self.waits_for = self._say_missing()
            return None, []
        if not self._checked:
            absent = self._find_absence()
            if absent is not None:
                self.waits_for = absent
                self._begin()
                return None, []
            self._checked = True
            changes = naming.present()
        named = np.full((self._model.n_markers, 3), np.nan)
        there = naming.names != GHOST
        named[naming.names[there]] = positions[there]
        return named, [self._describe(one) for one in changes]

    @property
    def confidence(self) -> dict[str, float]:
        """How sure each name of the last frame is."""
        sure = self._naming.confidence
        return {
            self._model.markers[marker]: round(float(one), 3)
            for marker, one in zip(self._naming.names, sure, strict=True)
            if marker != GHOST
        }

    def _begin(self) -> None:
        self._naming = OnlineNaming(
            self._model, self._required, self._n_columns, self.format.rate_hz
        )

    def _say_missing(self) -> str:
        names = self._naming.names
        missing = [k for k in self._required if k not in names]
        found = len(self._required) - len(missing)
        without = ", ".join(self._model.markers[k] for k in missing)
        return f"{found} of {len(self._required)} required markers found, without {without}"

    def _find_absence(self) -> str | None:
        """Tell why what was found is no person; None if it is one."""
        places, markers = self._naming.window()
        paths = {}
        for k in range(self._model.n_markers):
            row, slot = np.nonzero(markers == k)
            if row.size:
                path = np.full((len(places), 3), np.nan)
                path[row] = places[row, slot]
                paths[self._model.markers[k]] = path
        return find_absence(paths, self._set, self._model, self.format.rate_hz)

    def _describe(self, change: NameChange) -> dict[str, Any]:
        markers = self._model.markers
        since_s = change.age / self.format.rate_hz
        return {
            "trajectory": change.column,
            "marker": None if change.marker == GHOST else markers[change.marker],
            "was": None if change.was == GHOST else markers[change.was],
            "confidence": round(change.confidence, 3),
            "for_s": round(min(since_s, LOOK_BACK_S), 4),
        }
