"""What every recording is held against once it is read, whatever its format.

What no camera delivers is refused; single samples that no body makes become gaps, with a warning.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecordingError
from besman.foreign.names import fault_of_characters, fault_of_name
from besman.geometry.gaps import find_runs
from besman.geometry.spikes import find_faults
from besman.io.warning import warn_of_file
from besman.records import Recording
from besman.records.recordings import FARTHEST_M, GREATEST_FRAME, RATES_HZ

# No capture volume is that large, but metres that are millimetres look like it.
_FARTHEST_MEDIAN_M = 100.0
# Places that a warning names; of more it says how many.
_MOST_NAMED = 4


def check_recording(recording: Recording, path: Path) -> Recording:
    """Refuse what cannot be a recording, and make gaps of samples that no body makes.

    Parameters
    ----------
    recording : Recording
        As its format's reader made it.
    path : Path
        Named in errors.

    Returns
    -------
    Recording
        The same one where nothing had to be left out.

    Raises
    ------
    RecordingError
        If a name has control characters or is there twice, or frames, rate or coordinates are out
        of all sense.

    Warns
    -----
    RecordingWarning
        With marker and frame, where samples became gaps (a coordinate is missing, or
        `besman.geometry.spikes`), and where a trajectory jumps for good.
    """
    if len(recording.time) < 2:
        raise RecordingError(f"{path}: a recording of one frame; expected at least two")
    fault = fault_of_characters(path.name)
    if fault is not None:
        raise RecordingError(f"{path}: the name of the file {fault}")
    names = check_names(recording.names, str(path))
    if names != recording.names:
        recording = replace(recording, names=names)
    check_rate(recording.rate_hz, str(path))
    last = recording.first_frame + len(recording.time) - 1
    if recording.first_frame < 0 or last > GREATEST_FRAME:
        raise RecordingError(
            f"{path}: frames {recording.first_frame} to {last}; expected 0 to {GREATEST_FRAME:.0e}"
        )
    recording = _leave_out_spikes(_leave_out_halves(recording))
    _check_distances(recording, path)
    return recording


def check_rate(rate_hz: float, where: str) -> None:
    """Refuse a rate that no system for recording movement has.

    Raises
    ------
    RecordingError
        If it is not within `besman.records.recordings.RATES_HZ`.
    """
    slowest, fastest = RATES_HZ
    if not slowest <= rate_hz <= fastest:
        raise RecordingError(
            f"{where}: {rate_hz:g} frames a second; expected {slowest:g} to {fastest:g}"
        )


def check_names(names: Sequence[str | None], where: str) -> tuple[str | None, ...]:
    """Return names of trajectories without spaces around them; one that is empty is none.

    Raises
    ------
    RecordingError
        If a name would steer a terminal, or is there twice.
    """
    for index, name in enumerate(names, start=1):
        fault = None if name is None else fault_of_name(name)
        if fault is not None:
            raise RecordingError(f"{where}: trajectory {index}: name {name!r:.60} {fault}")
    given = tuple((name.strip() if name else "") or None for name in names)
    doubled = [name for name, count in Counter(given).items() if name and count > 1]
    if doubled:
        raise RecordingError(
            f"{where}: {given.count(doubled[0])} trajectories are named {doubled[0]!r:.60}; "
            "expected each name once"
        )
    return given


def _leave_out_halves(recording: Recording) -> Recording:
    """Make gaps of samples of which a coordinate is missing, and say so."""
    x, y, z = np.moveaxis(np.isnan(recording.positions), 2, 0)
    seen_in_part = np.asarray((x | y | z) & ~(x & y & z))
    if not seen_in_part.any():
        return recording
    _warn_of_gaps(recording, seen_in_part, "without all three coordinates")
    return replace(
        recording, positions=np.where(seen_in_part[:, :, None], np.nan, recording.positions)
    )


def _leave_out_spikes(recording: Recording) -> Recording:
    """Make gaps of samples that no body makes; say so, and where a trajectory jumps for good."""
    named = np.array([name is not None for name in recording.names])
    faults = find_faults(recording.positions, recording.rate_hz, named)
    if faults.jumps:
        row, column = faults.jumps[0]
        warn_of_file(
            f"{recording.source}: {_count(len(faults.jumps), 'step')} faster than anything that a "
            f"camera sees: {_call(recording, column)} at frame {recording.first_frame + row}"
            f"{' first' if len(faults.jumps) > 1 else ''}; two things under one name?"
        )
    if not faults.spikes.any():
        return recording
    # Programs put the pose of the skeleton, arms held out, before a movement.
    is_pose = recording.origin is not None and recording.origin.format == "BVH"
    is_pose = is_pose and not faults.spikes[1:].any()
    what = "of a pose before the movement" if is_pose else "that no body makes"
    _warn_of_gaps(recording, faults.spikes, what)
    positions = np.where(faults.spikes[:, :, None], np.nan, recording.positions)
    orientations = recording.orientations
    if orientations is not None:
        orientations = _hold(orientations, faults.spikes)
    return replace(recording, positions=positions, orientations=orientations)


def _warn_of_gaps(recording: Recording, left_out: npt.NDArray[np.bool_], what: str) -> None:
    """Say which samples became gaps."""
    count = int(left_out.sum())
    became = "became a gap" if count == 1 else "became gaps"
    warn_of_file(
        f"{recording.source}: {_count(count, 'sample')} {what} {became}: "
        f"{_list(_places(recording, left_out))}"
    )


def _hold(
    orientations: npt.NDArray[np.float64], left_out: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float64]:
    """Return orientations (T, M, 4) with those of samples left out as they were last before."""
    rows = np.arange(len(orientations))
    held = orientations.copy()
    for column in np.flatnonzero(left_out.any(axis=0)):
        kept = rows[~left_out[:, column]]
        if kept.size:
            before = np.searchsorted(kept, rows, side="right") - 1
            held[:, column] = orientations[kept[np.maximum(before, 0)], column]
    return held


def _places(recording: Recording, spikes: npt.NDArray[np.bool_]) -> list[str]:
    """Say where spikes are, by marker and frames."""
    found = []
    for column in np.flatnonzero(spikes.any(axis=0)):
        for start, end in find_runs(spikes[:, column]) + recording.first_frame:
            frames = f"frame {start}" if end - start == 1 else f"frames {start} to {end - 1}"
            found.append(f"{_call(recording, int(column))} {frames}")
    return found


def _check_distances(recording: Recording, path: Path) -> None:
    """Refuse coordinates that no camera sees."""
    positions = recording.positions
    greatest = float(
        max(
            np.fmax.reduce(positions, axis=None, initial=0.0),
            -np.fmin.reduce(positions, axis=None, initial=0.0),
        )
    )
    if greatest <= _FARTHEST_MEDIAN_M:
        return
    distances = np.abs(positions[~np.isnan(positions)])
    median = float(np.median(distances))
    if median > _FARTHEST_MEDIAN_M:
        raise RecordingError(
            f"{path}: half of all coordinates are beyond {_FARTHEST_MEDIAN_M:g} m (median "
            f"{median:.4g} m); are the units of the file right?"
        )
    far = np.argwhere((np.abs(positions) > FARTHEST_M).any(axis=2))
    if far.size:
        row, column = (int(index) for index in far[0])
        raise RecordingError(
            f"{path}: {_call(recording, column)} is {greatest:.4g} m away at frame "
            f"{recording.first_frame + row} ({_count(len(far), 'sample')} beyond "
            f"{FARTHEST_M:g} m); is the file damaged?"
        )


def _call(recording: Recording, column: int) -> str:
    name = recording.names[column]
    return f"trajectory {column + 1}" if name is None else repr(name)


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _list(places: Sequence[str]) -> str:
    rest = len(places) - _MOST_NAMED
    return ", ".join(places[:_MOST_NAMED]) + (f" and {rest} more" if rest > 0 else "")
