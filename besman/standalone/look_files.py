"""What is in a recording, for a person who sees it for the first time."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import (
    BesmanError,
    LabellingError,
    RecognitionError,
    RecordingError,
    RecordingWarning,
)
from besman.geometry.gaps import find_runs, find_seen
from besman.geometry.row_blocks import by_rows
from besman.io.recordings.folders import find_recordings, look_into
from besman.io.recordings.formats import FORMATS, KNOWN_FORMATS, read_recording, recognise
from besman.io.recordings.subjects import find_subjects
from besman.io.ring_landings import find_ring_landing
from besman.io.segments_json import SEGMENTS_SUFFIX
from besman.person.body import find_body
from besman.person.marker_set import MarkerSet, load_marker_set
from besman.person.marker_set_fit import SetFit, fit_marker_set, fit_marker_sets
from besman.records import FloatArray, LabelledRecording, Origin, Recording
from besman.stages.label.stage import LabelConfig
from besman.standalone.unknown_file import describe_unknown, is_like_recording

_HEAD_BYTES = 16_384
_UNKNOWN = "a format that is not known"
_MOST_MEASURED = 100_000  # samples by which an extent is told
_STEP_S = 0.1  # over which speeds are measured: noise of single frames is no movement
_MANY_ALIKE = 20  # files whose names differ in a number have one line
STILL_M = 0.02
"""What keeps within a cube of this edge stands still, metres."""


@dataclass(frozen=True)
class Look:
    """What one recording holds.

    Attributes
    ----------
    path : Path
    recording : Recording
    trajectories : list of dict
        Of each: ``name``, ``seen_share``, ``gaps``, ``longest_gap_s``, ``path_m`` (way travelled),
        ``span_m`` (longest edge of the box it keeps in) and ``greatest_speed_m_s``.
    fits : tuple of SetFit
        Marker sets, the best first.
    fault : str
        Why the best set's markers cannot be used as they are; empty if they can, or none fits.
    needed_gap_s : float
        Longest gap of a required marker that has to be filled beyond what usually is; 0 if none.
    warnings : tuple of str
        What reading warned of.
    asked : str
        The one marker set that was held against it, as it was asked for; empty for all.
    """

    path: Path
    recording: Recording
    trajectories: list[dict[str, Any]]
    fits: tuple[SetFit, ...]
    fault: str
    needed_gap_s: float
    warnings: tuple[str, ...]
    asked: str = ""

    @property
    def best(self) -> SetFit | None:
        """The marker set that fits best; None if the names are of none."""
        return self.fits[0] if self.fits else None

    @property
    def n_named(self) -> int:
        """How many trajectories have a name."""
        return sum(name is not None for name in self.recording.names)

    @property
    def origin(self) -> Origin:
        """How the file was understood."""
        return self.recording.origin or Origin()

    @property
    def landing_m(self) -> tuple[float, ...] | None:
        """Where a ball came down, as the file says, in the recording's frame."""
        with warnings.catch_warnings():
            # Whoever asks says himself that no ring is near.
            warnings.simplefilter("ignore", RecordingWarning)
            landing = find_ring_landing(self.recording)
        return None if landing is None else tuple(landing.place.tolist())

    @property
    def duration_s(self) -> float:
        """From the first frame to the end of the last one."""
        return len(self.recording.time) / self.recording.rate_hz

    @property
    def subjects(self) -> tuple[str, ...]:
        """What stands before names, such as the person they belong to."""
        return find_subjects(self.recording.names)


def look_at(path: Path, markers: str | None = None) -> Look:
    """Read a recording and find out what is in it.

    Parameters
    ----------
    path : Path
        A file of any format.
    markers : str, optional
        The one marker set to hold against it, by name or by file; all there are if not given.

    Returns
    -------
    Look

    Raises
    ------
    RecordingError
        If it cannot be read; of a file of no known format it says what that looks like.
    ConfigError
        If there is no such marker set.
    """
    with warnings.catch_warnings(record=True) as caught:
        recording = _read(path)
        is_turned = recording.orientations is not None and not _is_turned_from_pose(recording)
        how = recording.names, recording.source, is_turned
        if markers is None:
            fits = fit_marker_sets(*how)
        else:
            asked = fit_marker_set(load_marker_set(markers), *how)
            fits = (asked,) if asked.found or any(recording.names) else ()
        fault, needed = _try_set(recording, fits[0]) if fits else ("", 0.0)
    said = [str(one.message) for one in caught if issubclass(one.category, RecordingWarning)]
    return Look(
        path,
        recording,
        [_measure(recording, column) for column in range(len(recording.names))],
        fits,
        fault,
        needed,
        tuple(said),
        markers or "",
    )


@dataclass(frozen=True)
class Gathered:
    """What there is to look at.

    Attributes
    ----------
    files : list of Path
        Recordings: files, and folders whose files hold a frame each.
    unread : list of (Path, str)
        What lies beside them and looks like one, with the reason why it is not read.
    others : list of Path
        Other files of folders, which are none and belong to none.
    """

    files: list[Path]
    unread: list[tuple[Path, str]]
    others: list[Path]


def gather(paths: list[Path]) -> Gathered:
    """Gather recordings in files and folders, and what is not read of the folders' other files.

    Raises
    ------
    RecordingError
        If a path does not exist, or a folder holds nothing that looks like a recording.
    """
    files: list[Path] = []
    unread: list[tuple[Path, str]] = []
    others: list[Path] = []
    for path in paths:
        inside = look_into(path) if path.is_dir() else None
        if inside is not None:
            unread += [(one.folder / one.pattern, one.describe()) for one in inside.refused]
            like = [one for one in inside.others if is_like_recording(one)]
            unread += [(one, describe_unknown(one)) for one in like]
            # Segments belong to a recording, and are read with it.
            rest = (one for one in inside.others if one not in like)
            others += [one for one in rest if not one.name.endswith(SEGMENTS_SUFFIX)]
            if not inside.recordings and (inside.refused or like):
                continue
        files += find_recordings([path])
    if len(unread) == 1 and not files:
        raise RecordingError(": ".join(map(str, unread[0])))
    return Gathered(list(dict.fromkeys(files)), unread, others)


def put_alike_together(found: list[Look | tuple[Path, str]]) -> list[Look | tuple[Path, str]]:
    """Return what was looked at, one line for many unread files that differ in a number alone."""
    from besman.io.recordings.frame_folder import group_numbered

    unread = [one for one in found if isinstance(one, tuple)]
    if len(unread) < _MANY_ALIKE:
        return found
    reasons = dict(unread)
    told: list[Look | tuple[Path, str]] = []
    for folder in dict.fromkeys(path.parent for path in reasons):
        names = [path.name for path in reasons if path.parent == folder]
        for (before, after), numbered in group_numbered(names).items():
            if len(numbered) >= _MANY_ALIKE:
                files = [folder / name for _, name in sorted(numbered)]
                said = f"{len(files)} files, the first: {reasons[files[0]]}"
                told.append((folder / f"{before}*{after}", said))
                reasons = {path: why for path, why in reasons.items() if path not in files}
    looks = [one for one in found if isinstance(one, Look)]
    return [*looks, *told, *reasons.items()]


def look_at_all(paths: list[Path], markers: str | None = None) -> list[Look | tuple[Path, str]]:
    """Look at several recordings; one that cannot be read is its path and the reason."""
    if markers is not None:
        load_marker_set(markers)  # a set that is not there is no fault of the recordings
    found: list[Look | tuple[Path, str]] = []
    for path in paths:
        try:
            found.append(look_at(path, markers))
        except BesmanError as error:
            reason = str(error).removeprefix(f"{path}: ").removeprefix(f"{path.name}: ")
            # A row has no place for all that could be.
            reason = reason.removeprefix(f"{_UNKNOWN}: ").removesuffix(
                f"; expected {KNOWN_FORMATS}"
            )
            found.append((path, reason))
    return found


def content_of(look: Look, commands: list[str]) -> dict[str, Any]:
    """Return what was found for JSON; `commands` are how to go on."""
    recording, origin = look.recording, look.origin
    return {
        "recording": str(look.path),
        "format": origin.format,
        "writer": origin.writer,
        "rate_hz": recording.rate_hz,
        "frames": len(recording.time),
        "first_frame": recording.first_frame,
        "duration_s": look.duration_s,
        "units": {"value": origin.units, "by": origin.units_by},
        "up": {"axis": origin.up, "by": origin.up_by},
        "notes": list(origin.notes),
        "warnings": list(look.warnings),
        "named": look.n_named,
        "unnamed": len(recording.names) - look.n_named,
        "subjects": list(look.subjects),
        "has_orientations": recording.orientations is not None,
        "extent_m": measure_extent(recording.positions).tolist(),
        "trajectories": look.trajectories,
        "marker_sets": [
            {
                "name": fit.marker_set.name,
                "markers": len(fit.found),
                "of": len(fit.marker_set.markers),
                "complete": fit.is_complete,
                "missing": list(fit.missing),
                "trajectories": fit.found,
                "fault": fit.fault,
            }
            for fit in look.fits
        ],
        "landing_m": None if look.landing_m is None else list(look.landing_m),
        "fault": look.fault,
        "next": commands,
    }


def measure_extent(positions: FloatArray) -> FloatArray:
    """Return the edges of the box that nearly all samples (T, M, 3) lie in, metres; NaN if none."""
    seen = by_rows(find_seen, positions)
    n_seen = int(np.count_nonzero(seen))
    if not n_seen:
        return np.full(3, np.nan)
    # Every so many of those seen; of an hour no copy is made.
    order = np.cumsum(np.count_nonzero(seen, axis=1))
    chosen = np.arange(0, n_seen, max(1, n_seen // _MOST_MEASURED))
    rows = np.searchsorted(order, chosen, side="right")
    nth = chosen - np.where(rows > 0, order[rows - 1], 0)
    columns = np.argmax(np.cumsum(seen[rows], axis=1) > nth[:, None], axis=1)
    low, high = np.percentile(positions[rows, columns], [0.5, 99.5], axis=0)
    return np.asarray(high - low)


def _read(path: Path) -> Recording:
    """Read a recording; of a format that is not known say what it looks like."""
    if path.is_file():
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
        if head.strip() and recognise(head) is None:
            raise RecordingError(
                f"{path}: {_UNKNOWN}: {describe_unknown(path)}; expected {KNOWN_FORMATS}"
            )
    return read_recording(path)


def _is_turned_from_pose(recording: Recording) -> bool:
    """Tell whether its bodies are turned from a pose of their own, whose axes no set knows."""
    origin = recording.origin or Origin()
    return any(entry.turns_from_pose for entry in FORMATS if entry.name == origin.format)


def _measure(recording: Recording, column: int) -> dict[str, Any]:
    """Measure one trajectory."""
    path = recording.positions[:, column]
    hidden = np.isnan(path[:, 0])
    runs = find_runs(hidden)
    longest = int((runs[:, 1] - runs[:, 0]).max()) if len(runs) else 0
    step = max(1, round(_STEP_S * recording.rate_hz))
    ways = np.linalg.norm(np.diff(path[::step], axis=0), axis=1)
    ways = ways[np.isfinite(ways)]
    seen = path[~hidden]
    return {
        "name": recording.names[column],
        "seen_share": float(1.0 - hidden.mean()),
        "gaps": len(runs),
        "longest_gap_s": longest / recording.rate_hz,
        "path_m": float(ways.sum()),
        "span_m": float(np.ptp(seen, axis=0).max()) if len(seen) else 0.0,
        "greatest_speed_m_s": float(ways.max() / (step / recording.rate_hz)) if len(ways) else 0.0,
    }


def _try_set(recording: Recording, fit: SetFit) -> tuple[str, float]:
    """Take the names as a run does; return why that fails, and how long a gap is to be filled."""
    if not fit.is_complete:
        return fit.fault, 0.0
    marker_set = fit.marker_set
    try:
        find_body((*fit.found, *marker_set.derived), recording.source)
    except RecognitionError as error:
        said = str(error).partition("; see:")[0]
        return said.removeprefix(f"{recording.source}: "), 0.0
    try:
        labelled = LabelConfig().take_given(recording, marker_set)
    except LabellingError as error:
        columns = marker_set.find(recording.names, recording.source)
        taken = LabelConfig().take_names(recording, columns, marker_set)
        return str(error).removeprefix(f"{recording.source}: "), _longest_gap(taken, marker_set)
    return _find_fault(labelled), 0.0


def _longest_gap(taken: LabelledRecording, marker_set: MarkerSet) -> float:
    """Return the longest gap of a required marker that is left, seconds; 0 if there is none."""
    runs = [find_runs(np.isnan(taken.marker(name)[:, 0])) for name in marker_set.required]
    longest = max((int((one[:, 1] - one[:, 0]).max()) for one in runs if len(one)), default=0)
    return longest / taken.rate_hz


def _find_fault(labelled: LabelledRecording) -> str:
    """Say what of a body is never there, though all required names are."""
    never = [
        name
        for column, name in enumerate(labelled.markers)
        if not np.isfinite(labelled.positions[:, column]).any()
    ]
    return f"never seen: {', '.join(never)}" if never else ""
