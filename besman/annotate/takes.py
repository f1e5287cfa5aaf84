"""The recordings of a session, each with its signals and its segments file."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

from besman.annotate.document import Document
from besman.annotate.named_file import NamedFile
from besman.annotate.naming import NamedView, Names, Naming, pack_markers
from besman.annotate.proposals import ProposedSegment, propose_stretches
from besman.annotate.signals import SignalPyramids
from besman.annotate.skeleton import find_bones
from besman.exceptions import AnnotationError, BesmanError, ChangedError, LabellingError
from besman.geometry.gaps import find_seen
from besman.geometry.row_blocks import by_rows
from besman.io.recordings.formats import read_recording
from besman.io.segments_json import segments_path
from besman.person.marker_set import MarkerSet, load_marker_set
from besman.records import LabelledRecording, Recording
from besman.records.layers import ACTIONS, Side
from besman.stages.label.joined_trajectories import WovenRecording
from besman.stages.label.results import trajectory_name
from besman.stages.label.stage import LabelConfig

MARKER_SETS = ("two_arms", "right_arm", "xsens", "exoskeleton")
"""Marker sets that are tried in this order where none is named."""

_LONGEST_GAP_S = 0.5


def side_of_layer(layer: str) -> Side | None:
    """Return the arm whose building blocks a layer holds, None of actions."""
    if layer.startswith(ACTIONS):
        return None
    return "left" if layer == "left_hand" else "right"


class Take:
    """One recording.

    Parameters
    ----------
    path : Path
        The recording.
    segments : Path, optional
        Its segments file; beside it if not given.
    markers : str, optional
        Marker set; the first that fits if not given.
    teacher : Recording, optional
        A recording with names, to name unnamed trajectories after.

    Attributes
    ----------
    recording : WovenRecording
        With the names that it has, or that labelling found.
    shown : WovenRecording
        The recording with the names that were found or given.
    naming : Naming or None
        What has no name, None if everything has.
    names : dict of int to str
        Names given to its fragments.
    names_revision : int
        How often they have changed.

    Raises
    ------
    BesmanError
        If the recording cannot be read or shows no marker, or the segments file cannot be read or
        written or belongs to another recording.
    """

    def __init__(
        self,
        path: Path,
        segments: Path | None = None,
        markers: str | None = None,
        teacher: Recording | None = None,
    ) -> None:
        self.path = path
        self.markers = markers
        self.naming: Naming | None = None
        self.names: dict[int, str] = {}
        self.names_revision = 0
        self.named_file = NamedFile(path)
        self._lock = threading.Lock()
        self.document, self.recording = self._read(segments, teacher)
        self._show(self.naming.view({}) if self.naming else NamedView(self.recording, {}))

    def _read(
        self, segments: Path | None, teacher: Recording | None
    ) -> tuple[Document, WovenRecording]:
        """Read the recording, and name what has no name; what was read is not kept."""
        recording = read_recording(self.path)
        if not by_rows(find_seen, recording.positions).any():
            raise AnnotationError(
                f"{self.path}: no marker is visible in any of {len(recording.time)} frames; there "
                "is nothing to annotate"
            )
        document = Document(segments or segments_path(self.path), recording)
        nameless = None in recording.names
        by = teacher if nameless and teacher is not None else recording
        marker_set = load_marker_set(self.markers or _guess_set(by))
        if not nameless:
            return document, pack_markers(WovenRecording.of(recording), marker_set)
        self.naming = Naming(recording, marker_set, teacher)
        return document, self.naming.base

    def give_names(self, names: Names, revision: int | None = None) -> None:
        """Give names to fragments; those not mentioned have none.

        Parameters
        ----------
        names : dict of int to str
            By number of the fragment.
        revision : int, optional
            How many changes of names the giver knows of.

        Raises
        ------
        ChangedError
            If names were given that the giver does not know of.
        AnnotationError
            If nothing is unnamed, or a name cannot be given; then all stays as it is.
        """
        if self.naming is None:
            raise AnnotationError(f"{self.path.name}: every trajectory has a name")
        with self._lock:
            if revision is not None and revision != self.names_revision:
                raise ChangedError(
                    f"{self.path.name}: names were given in another window in the meantime; "
                    "reload this page"
                )
            self._show(self.naming.view(names))
            self.names_revision += names != self.names
            self.names = dict(names)

    def write_names(self) -> Path:
        """Write the recording with the names given, beside the one that was read.

        Raises
        ------
        BesmanError
            If it cannot be written.
        """
        with self._lock:
            return self.named_file.write(self.shown)

    def _show(self, view: NamedView) -> None:
        """Show a recording; what was computed of another is forgotten."""
        self.shown, self._columns = view
        self.signals = SignalPyramids(self.shown)
        self._labelled: tuple[LabelledRecording, MarkerSet] | BesmanError | None = None
        self._stretches: dict[str, list[ProposedSegment]] = {}

    def labelled(self) -> tuple[LabelledRecording, MarkerSet]:
        """Return the recording with the names of a marker set, and the set.

        Raises
        ------
        BesmanError
            If no set fits, or a marker is hidden for too long.
        """
        with self._lock:
            if self._labelled is None:
                self._labelled = self._label()
            # Outside the lock it may be gone again, because other names were given.
            labelled = self._labelled
        if isinstance(labelled, BesmanError):
            raise labelled
        return labelled

    def stretches(self, layer: str) -> list[ProposedSegment]:
        """Return proposals for the segments of a layer, computed once.

        Raises
        ------
        BesmanError
            If there are none for this layer or recording.
        """
        recording, marker_set = self.labelled()
        side = side_of_layer(layer)
        role = {"right": "hand", "left": "left_hand"}.get(side or "")
        if role is None:
            raise AnnotationError(
                "proposals are for the layers of hands; actions are yours to name"
            )
        if role not in marker_set.roles:
            raise AnnotationError(
                f"layer {layer!r}: marker set {marker_set.name} has no role {role!r}; expected a "
                "recording of that arm"
            )
        hand = marker_set.roles[role]
        with self._lock:
            if not isinstance(self._labelled, tuple) or self._labelled[0] is not recording:
                # Other names were given in the meantime: these are borders of what was.
                return propose_stretches(recording, hand)
            if hand not in self._stretches:
                self._stretches[hand] = propose_stretches(recording, hand)
            return self._stretches[hand]

    def about(self) -> dict[str, Any]:
        """Return what the page needs to know of the recording."""
        with self._lock:
            return self._about()

    def _about(self) -> dict[str, Any]:
        recording = self.shown
        names = [trajectory_name(recording.names, k) for k in range(len(recording.names))]
        first = recording.time[0]
        return {
            "name": self.path.name,
            "segments_path": str(self.document.path),
            "rate_hz": recording.rate_hz,
            "n_samples": len(recording.time),
            "first_frame": recording.first_frame,
            "start_s": float(first),
            "duration_s": float(recording.time[-1] - first),
            "markers": names,
            "named": [name is not None for name in recording.names],
            "bones": find_bones(recording.names),
            "n_levels": self.signals.n_levels,
            "revision": self.document.revision,
            "segments": self.document.page_rows(),
            "naming": self._about_naming(),
        }

    def _about_naming(self) -> dict[str, Any] | None:
        """Return the fragments without a name, None if everything has one."""
        if self.naming is None:
            return None
        return {
            "fragments": [
                {**one._asdict(), "column": self._columns.get(one.column)}
                for one in self.naming.fragments
            ],
            "names": {str(number): name for number, name in self.names.items()},
            "revision": self.names_revision,
            "note": self.naming.note,
            "path": str(self.named_file.path),
        }

    def _label(self) -> tuple[LabelledRecording, MarkerSet] | BesmanError:
        """Find a marker set that fits."""
        error: BesmanError | None = None
        for name in [self.markers] if self.markers else MARKER_SETS:
            marker_set = load_marker_set(name)
            try:
                label = LabelConfig(markers=name, longest_gap_s=_LONGEST_GAP_S)
                labelled = label.take_given(self.shown, marker_set)
                # Files of one name in several folders are not to be taken for each other.
                return replace(labelled, source=str(self.path)), marker_set
            except LabellingError as failure:
                # Of sets that do not fit, that of one arm says best what is missing.
                if error is None or name == "right_arm" or self._fits(marker_set):
                    error = failure
        return error or LabellingError(f"{self.path}: no marker set fits")

    def _fits(self, marker_set: MarkerSet) -> bool:
        try:
            marker_set.match(self.shown.names, self.shown.source)
        except LabellingError:
            return False
        return True


def _guess_set(named: Recording) -> str:
    """Return the marker set to name trajectories by: that of the names there are."""
    for name in MARKER_SETS:
        try:
            load_marker_set(name).match(named.names, named.source)
        except LabellingError:
            continue
        return name
    return "right_arm"


def shares_side(layer: str, other: str) -> bool:
    """Tell whether segments of one layer teach the names of another: blocks of the same arm."""
    side = side_of_layer(layer)
    return side is not None and side == side_of_layer(other)
