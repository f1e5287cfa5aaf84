"""Names for what automatic labelling left without one, given by a person.

A recording with unnamed trajectories is labelled as ``besman label-markers`` does, unless it has
names already; what stays unnamed is cut into unbroken fragments, and each of these may be given the
name of a marker that is not seen at the same time, or be called a ghost: a reflection, no marker.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from besman.exceptions import AnnotationError, LabellingError, nearest
from besman.geometry.gaps import find_runs
from besman.person.marker_set import MarkerSet, normalise_name
from besman.records import Recording
from besman.stages.label.gather import found_markers
from besman.stages.label.joined_trajectories import (
    PiecedPath,
    WovenRecording,
    is_seen,
    lay_out,
    split_path,
    weave_names,
)
from besman.stages.label.stage import LabelTrajectoriesConfig
from besman.stages.label.trajectories import decide_names

GHOST = ""
"""Name of a fragment that is no marker."""

Names = Mapping[int, str]
"""Names of fragments, by their number."""

# A marker that vanished is looked for so long before and after.
_NEAR_S = 1.0


class Fragment(NamedTuple):
    """An unbroken stretch of an unnamed trajectory.

    Attributes
    ----------
    column : int
        Trajectory of `Naming.base`.
    start, end : int
        Half-open rows.
    best : str
        What automatic labelling takes it for; "" if for no marker, or if it cannot say.
    confidence : float
        Of that; 0 if it cannot say.
    review : bool
        Whether labelling was too little sure to decide.
    """

    column: int
    start: int
    end: int
    best: str
    confidence: float
    review: bool


class NamedView(NamedTuple):
    """A recording with names given, and where the trajectories without one are in it."""

    recording: WovenRecording
    columns: dict[int, int]


class Naming:
    """The unnamed fragments of one recording.

    Parameters
    ----------
    recording : Recording
        With at least one unnamed trajectory.
    marker_set : MarkerSet
        Names that may be given.
    teacher : Recording, optional
        A recording with names, from which distances of markers are learnt.

    Attributes
    ----------
    base : WovenRecording
        The recording with the names that it has or that labelling found.
    fragments : list of Fragment
        First those for review, then what labelling takes for no marker; long ones first.
    note : str
        Why labelling found no names, "" if it did.
    """

    def __init__(
        self, recording: Recording, marker_set: MarkerSet, teacher: Recording | None = None
    ) -> None:
        self.marker_set = marker_set
        self.note = ""
        base, fragments = self._label(recording, teacher)
        self.base = pack_markers(base, marker_set)
        self.fragments = sorted(
            fragments, key=lambda one: (not one.review, one.start - one.end, one.start, one.column)
        )

    def view(self, names: Names) -> NamedView:
        """Give names to fragments.

        Parameters
        ----------
        names : mapping of int to str
            Marker of some fragments by their number, `GHOST` for none.

        Returns
        -------
        NamedView
            First what has a name, in the order of the marker set; ghosts are left out.

        Raises
        ------
        AnnotationError
            If there is no such fragment or marker, or the marker is seen at the same time.
        """
        paths = self._named_paths()
        rest = {k: self.base.paths[k] for k, name in enumerate(self.base.names) if name is None}
        for number, name in sorted(names.items()):
            fragment = self._fragment(number)
            rows, column = (fragment.start, fragment.end), fragment.column
            given, rest[column] = split_path(rest[column], *rows)
            if name != GHOST:
                if name not in paths:
                    raise AnnotationError(f"no marker {name!r}; {nearest(name, paths)}")
                self._refuse_twice(paths[name], name, fragment)
                paths[name] = (*split_path(paths[name], *rows)[1], *given)
        named = [name for name, path in paths.items() if is_seen(path)]
        unnamed = [column for column, path in rest.items() if is_seen(path)]
        every = (*named, *(None,) * len(unnamed))
        shown = [*(paths[name] for name in named), *(rest[column] for column in unnamed)]
        recording = WovenRecording(self.base.frames, every, shown)
        if every == self.base.names and not names:
            # What is packed to be filled is filled in place.
            recording = self.base
        return NamedView(recording, {column: len(named) + k for k, column in enumerate(unnamed)})

    def candidates(self, number: int, names: Names) -> list[tuple[str, bool]]:
        """Return the names that a fragment may get, the likely ones first, and which are free.

        Likely is what labelling takes it for, then what was seen near it shortly before or after.

        Parameters
        ----------
        number : int
            Of the fragment.
        names : mapping of int to str
            Given so far.

        Raises
        ------
        AnnotationError
            If there is no such fragment.
        """
        fragment = self._fragment(number)
        paths = self._named_paths()
        for other, name in names.items():
            if other != number and name in paths:
                one = self._fragment(other)
                given, _ = split_path(self.base.paths[one.column], one.start, one.end)
                paths[name] = (*split_path(paths[name], one.start, one.end)[1], *given)
        found = []
        for order, (name, path) in enumerate(paths.items()):
            taken = bool(np.isfinite(lay_out(path, fragment.start, fragment.end)).any())
            away = self._distance(path, fragment)
            found.append((taken, name != fragment.best, away, order, name))
        return [(name, not taken) for taken, _, _, _, name in sorted(found)]

    def _label(
        self, recording: Recording, teacher: Recording | None
    ) -> tuple[WovenRecording, list[Fragment]]:
        """Return the recording with names, and its fragments."""
        named = any(recording.names)
        config = LabelTrajectoriesConfig(markers=self.marker_set.name)
        try:
            # A recording with names teaches how its own markers are apart.
            model = config.learn(self.marker_set, teacher or (recording if named else None))
            decisions = decide_names(recording, self.marker_set, model, config.threshold)
        except LabellingError as error:
            self.note = str(error)
            return WovenRecording.of(recording), _cut(recording)
        if named:
            base = WovenRecording.of(recording)
            columns = {k: k for k, name in enumerate(recording.names) if name is None}
        else:
            markers = found_markers(decisions, self.marker_set)
            base, columns = weave_names(recording, decisions, markers)
            decisions = tuple(one for one in decisions if not one.named)
        return base, [
            Fragment(
                columns[one.trajectory],
                one.start,
                one.stop,
                one.marker,
                one.confidence,
                one.confidence < config.threshold or bool(one.marker),
            )
            for one in decisions
            if one.trajectory in columns
        ]

    def _fragment(self, number: int) -> Fragment:
        if not 0 <= number < len(self.fragments):
            raise AnnotationError(
                f"fragment {number}: there are {len(self.fragments)}, counted from 0"
            )
        return self.fragments[number]

    def _named_paths(self) -> dict[str, PiecedPath]:
        """Return the paths of all names that there may be, by the set's order.

        Names of the recording that are not in the set come last.
        """
        spelt: dict[str, str] = {}
        for name in filter(None, self.base.names):
            spelt.setdefault(normalise_name(name), name)
        paths = {}
        for marker, aliases in self.marker_set.markers.items():
            known = (spelt.get(normalise_name(one)) for one in (marker, *aliases))
            name = next(filter(None, known), marker)
            paths[name] = self._path_of(name)
        others = (name for name in self.base.names if name and name not in paths)
        return paths | {name: self._path_of(name) for name in others}

    def _path_of(self, name: str) -> PiecedPath:
        return self.base.paths[self.base.names.index(name)] if name in self.base.names else ()

    def _refuse_twice(self, path: PiecedPath, name: str, fragment: Fragment) -> None:
        """Refuse a name that another dot has at the same time."""
        places = lay_out(path, fragment.start, fragment.end)
        seen = np.flatnonzero(np.isfinite(places[:, 0]))
        if len(seen):
            first = self.base.first_frame + fragment.start
            raise AnnotationError(
                f"{name} is seen already in frames {first + seen[0]} to {first + seen[-1]}; "
                "expected one dot of a name at a time"
            )

    def _distance(self, path: PiecedPath, fragment: Fragment) -> float:
        """Return how far a marker is, just before or after, from where a fragment begins or ends.

        Metres; infinite where it is not seen near in time.
        """
        near = max(1, round(_NEAR_S * self.base.rate_hz))
        own = lay_out(self.base.paths[fragment.column], fragment.start, fragment.end)
        before = lay_out(path, max(0, fragment.start - near + 1), fragment.start)[::-1]
        after = lay_out(path, fragment.end, min(len(self.base.time), fragment.end + near))
        best = np.inf
        for places, end in ((before, own[0]), (after, own[-1])):
            seen = np.flatnonzero(np.isfinite(places[:, 0]))
            if seen.size:
                best = min(best, float(np.linalg.norm(places[seen[0]] - end)))
        return best


def pack_markers(recording: WovenRecording, marker_set: MarkerSet) -> WovenRecording:
    """Return a recording that holds nothing of what was read but what is seen.

    The markers of a set, if they are all called by its names, are ready to be filled.
    """
    try:
        columns = marker_set.find(recording.names, recording.source)
    except LabellingError:
        columns = {}
    return recording.pack(tuple(columns.values()))


def _cut(recording: Recording) -> list[Fragment]:
    """Cut the unnamed trajectories into fragments where they were not seen."""
    return [
        Fragment(column, int(start), int(end), "", 0.0, True)
        for column, name in enumerate(recording.names)
        if name is None
        for start, end in find_runs(
            np.asarray(np.isfinite(recording.positions[:, column]).all(axis=1), dtype=np.bool_)
        )
    ]
