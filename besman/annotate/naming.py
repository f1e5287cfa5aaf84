"""Names for what automatic labelling left without one, given by a person.

A recording with unnamed trajectories is labelled as ``besman label-markers`` does, unless it has
names already; what stays unnamed is cut into unbroken fragments, and each of these may be given the
name of a marker that is not seen at the same time, or be called a ghost: a reflection, no marker.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np

from besman.exceptions import AnnotationError, LabellingError, nearest
from besman.geometry.gaps import find_runs
from besman.person.marker_set import MarkerSet, normalise_name
from besman.records import FloatArray, Recording
from besman.records.frozen import hand_over
from besman.stages.label.gather import found_markers, gather_all
from besman.stages.label.stage import LabelTrajectoriesConfig
from besman.stages.label.trajectories import decide_names

GHOST = ""
"""Name of a fragment that is no marker."""

Names = Mapping[int, str]
"""Names of fragments, by their number."""

_Key = TypeVar("_Key")

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

    recording: Recording
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
    base : Recording
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
        self.base, fragments = self._label(recording, teacher)
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
        rest = {k: self._column(k) for k, name in enumerate(self.base.names) if name is None}
        for number, name in sorted(names.items()):
            fragment = self._fragment(number)
            rows, column = slice(fragment.start, fragment.end), fragment.column
            if name != GHOST:
                if name not in paths:
                    raise AnnotationError(f"no marker {name!r}; {nearest(name, paths)}")
                self._refuse_twice(paths[name], name, fragment)
                _writable(paths, name)[rows] = rest[column][rows]
            _writable(rest, column)[rows] = np.nan
        named = [name for name, path in paths.items() if np.isfinite(path).any()]
        unnamed = [column for column, path in rest.items() if np.isfinite(path).any()]
        every = (*named, *(None,) * len(unnamed))
        recording = self.base
        if names or every != recording.names or recording.orientations is not None:
            shown = np.stack([paths[name] for name in named] + [rest[k] for k in unnamed], axis=1)
            recording = replace(
                recording, positions=hand_over(shown), names=every, orientations=None
            )
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
                rows = slice(one.start, one.end)
                _writable(paths, name)[rows] = self._column(one.column)[rows]
        found = []
        for order, (name, path) in enumerate(paths.items()):
            taken = bool(np.isfinite(path[fragment.start : fragment.end]).any())
            away = self._distance(path, fragment)
            found.append((taken, name != fragment.best, away, order, name))
        return [(name, not taken) for taken, _, _, _, name in sorted(found)]

    def _label(
        self, recording: Recording, teacher: Recording | None
    ) -> tuple[Recording, list[Fragment]]:
        """Return the recording with names, and its fragments."""
        named = any(recording.names)
        config = LabelTrajectoriesConfig(markers=self.marker_set.name)
        try:
            # A recording with names teaches how its own markers are apart.
            model = config.learn(self.marker_set, teacher or (recording if named else None))
            decisions = decide_names(recording, self.marker_set, model, config.threshold)
        except LabellingError as error:
            self.note = str(error)
            return recording, _cut(recording)
        base, columns = recording, {k: k for k, name in enumerate(recording.names) if name is None}
        if not named:
            markers = found_markers(decisions, self.marker_set)
            positions, names = gather_all(recording, decisions, markers)
            base = replace(recording, positions=hand_over(positions), names=names)
            decisions = tuple(one for one in decisions if not one.named)
            # Trajectories that keep something unnamed follow the markers, in their order.
            left = sorted({one.trajectory for one in decisions})
            columns = {column: len(markers) + k for k, column in enumerate(left)}
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

    def _named_paths(self) -> dict[str, FloatArray]:
        """Return the paths of all names that there may be, NaN where not seen, by the set's order.

        They are read-only. Names of the recording that are not in the set come last.
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

    def _path_of(self, name: str) -> FloatArray:
        if name in self.base.names:
            return self._column(self.base.names.index(name))
        return np.broadcast_to(np.nan, (len(self.base.time), 3))

    def _column(self, column: int) -> FloatArray:
        """Return a trajectory of `base`, shape (T, 3), read-only."""
        path: FloatArray = self.base.positions[:, column]
        return path

    def _refuse_twice(self, path: FloatArray, name: str, fragment: Fragment) -> None:
        """Refuse a name that another dot has at the same time."""
        seen = np.flatnonzero(np.isfinite(path[fragment.start : fragment.end, 0]))
        if len(seen):
            first = self.base.first_frame + fragment.start
            raise AnnotationError(
                f"{name} is seen already in frames {first + seen[0]} to {first + seen[-1]}; "
                "expected one dot of a name at a time"
            )

    def _distance(self, path: FloatArray, fragment: Fragment) -> float:
        """Return how far a marker is, just before or after, from where a fragment begins or ends.

        Metres; infinite where it is not seen near in time.
        """
        near = max(1, round(_NEAR_S * self.base.rate_hz))
        own = self.base.positions[:, fragment.column]
        best = np.inf
        for rows, place in (
            (range(fragment.start - 1, max(-1, fragment.start - near), -1), own[fragment.start]),
            (range(fragment.end, min(len(path), fragment.end + near)), own[fragment.end - 1]),
        ):
            seen = next((row for row in rows if np.isfinite(path[row, 0])), None)
            if seen is not None:
                best = min(best, float(np.linalg.norm(path[seen] - place)))
        return best


def _writable(paths: dict[_Key, FloatArray], key: _Key) -> FloatArray:
    """Return a path to be written to: of one that may not, its copy, which takes its place."""
    if not paths[key].flags.writeable:
        paths[key] = np.array(paths[key])
    return paths[key]


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
