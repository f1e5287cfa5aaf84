"""Frames and times of rows, and the rate: what a header says beside what the columns count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecordingError
from besman.foreign.numbers import parse_number
from besman.io.recordings.format import READING
from besman.io.warning import warn_of_file
from besman.records import FloatArray
from besman.records.recordings import GREATEST_FRAME, RATES_HZ

Lines = int | Sequence[int] | None
# Times are rounded in files; a clock that disagrees more than this runs at another rate.
_TOLERANCE = 0.05
# A step of time may deviate this much from the usual one.
_UNEVEN = 0.5
# A rate is meant to be whole if it is this near, or as near as times tell that are rounded so.
_WHOLE = 5e-4
_ROUNDED = (1e-2, 1e-3, 1e-4)
# Seconds up to which a double has these steps.
_LATEST = 1e11
# What times may count, in a second.
_PARTS_OF_SECOND = (1.0, 1e3, 1e6, 1e9)
TIME_NAMES: dict[str, float | None] = (
    dict.fromkeys(("time", "timestamp", "t"), None)
    | dict.fromkeys(("time_s", "time (s)", "time (seconds)", "seconds"), 1.0)
    | dict.fromkeys(("time_ms", "time (ms)", "timestamp_ms", "univTime"), 1e3)
    | dict.fromkeys(("timestamp_us", "timestamp_usec"), 1e6)
    | {"timestamp_ns": 1e9}
)
"""What columns of times are called, and how many of what they count a second has, if it says so."""


@dataclass(frozen=True)
class RowClock:
    """When the rows of a table were.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds, evenly spaced; of missing frames too.
    rate_hz : float
    first_frame : int
    rows : int array or None
        Where the rows of the table stand in `time`; None if no frame is missing.
    """

    time: FloatArray
    rate_hz: float
    first_frame: int
    rows: npt.NDArray[np.int64] | None

    def spread(self, values: FloatArray) -> FloatArray:
        """Return values of rows (N, ...) for all frames (T, ...), NaN where one is missing."""
        if self.rows is None:
            return values
        spread = np.full((len(self.time), *values.shape[1:]), np.nan)
        spread[self.rows] = values
        return spread


def settle_clock(
    frames: FloatArray | None,
    times: FloatArray | None,
    rate_hz: float | None,
    path: Path,
    first_line: Lines,
    first_time: float | None = None,
) -> RowClock:
    """Settle frames, times and rate of rows.

    Parameters
    ----------
    frames, times : array, shape (N,), or None
        What the columns say; seconds.
    rate_hz : float or None
        What the header says, as `read_rate` returns it.
    path : Path
        Named in messages.
    first_line : int, sequence of int, length N, or None
        Number of the first row's line in the file, or of each row's, for messages; None where rows
        are no lines.
    first_time : float, optional
        Seconds of the first row where no column says it.

    Returns
    -------
    RowClock

    Raises
    ------
    RecordingError
        If frames or times do not rise, or nothing tells the rate.

    Warns
    -----
    RecordingWarning
        If frames are missing, times uneven, or the times run at another rate than the header says,
        or what it says is none: theirs counts then.
    """
    frames = None if frames is None or np.isnan(frames).all() else frames
    times = None if times is None or np.isnan(times).all() else times
    asked_hz = READING.get().rate_hz
    if times is not None and asked_hz is None and _stands_still(times, rate_hz, path):
        times = None
    n_rows = len(frames if frames is not None else times if times is not None else ())
    if n_rows == 1:
        raise RecordingError(f"{path}: a recording of one frame; expected at least two")
    rows = np.arange(n_rows) if frames is None else _count(frames, path, first_line)
    if asked_hz is None:
        shown_hz = None if times is None else _show_rate(times, rows, path, first_line)
        rate = _choose_rate(rate_hz, shown_hz, path)
    else:
        rate = asked_hz
    first_frame = 1 if frames is None else int(frames[0])
    if times is not None and np.isfinite(times[0]):
        first_time = float(times[0])
    elif first_time is None:
        first_time = max(first_frame - 1, 0) / rate
    n_frames = int(rows[-1]) + 1
    return RowClock(
        first_time + np.arange(n_frames) / rate,
        rate,
        first_frame,
        None if n_frames == n_rows else rows,
    )


def read_rate(text: str) -> float | None:
    """Return the rate that a header says: None where it says none, NaN where that is no number."""
    if text.strip().upper() in {"", "EXT"}:
        return None
    try:
        return parse_number(text.replace(",", "."))
    except ValueError:
        return float("nan")


def in_seconds(times: FloatArray, name: str, rate_hz: float | None = None) -> FloatArray:
    """Return times in seconds, of a column that may count milliseconds, micro- or nanoseconds.

    Parameters
    ----------
    times : array, shape (N,)
    name : str
        Of `TIME_NAMES`.
    rate_hz : float or None
        Frames per second, where something says it. If not no frame lasts longer than a second.
    """
    said = TIME_NAMES[name]
    if said is not None:
        return times / said
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if rate_hz is None:
        parts = next((one for one in _PARTS_OF_SECOND if step <= one), 1.0)
    else:
        usual = (one for one in _PARTS_OF_SECOND if 0.5 * one < step * rate_hz < 2.0 * one)
        parts = next(usual, 1.0)
    return times / parts


def _count(frames: FloatArray, path: Path, first_line: Lines) -> npt.NDArray[np.int64]:
    """Return the places of rows by their frames, from 0."""
    wrong = np.flatnonzero(
        ~((frames == np.round(frames)) & (frames >= 0) & (frames <= GREATEST_FRAME))
    )
    if wrong.size:
        row = int(wrong[0])
        raise RecordingError(
            f"{_place(path, row, first_line)}: frame is {frames[row]:g}; expected a whole "
            f"number from 0 to {GREATEST_FRAME:.0e}"
        )
    steps = np.diff(frames)
    falling = np.flatnonzero(steps <= 0)
    if falling.size:
        row = int(falling[0]) + 1
        raise RecordingError(
            f"{_place(path, row, first_line)}: frame {frames[row]:.0f} follows frame "
            f"{frames[row - 1]:.0f}; expected frames that rise"
        )
    step = float(steps.min()) if steps.size else 1.0
    places = (frames - frames[0]) / step
    n_missing = int(places[-1]) + 1 - len(frames)
    if n_missing == 0:
        return np.arange(len(frames))
    row = int(np.flatnonzero(steps != step)[0]) + 1
    if not np.array_equal(places, np.round(places)) or n_missing > len(frames):
        raise RecordingError(
            f"{_place(path, row, first_line)}: frame {frames[row]:.0f} follows frame "
            f"{frames[row - 1]:.0f}; expected frames that rise evenly"
        )
    warn_of_file(
        f"{path.name}: {n_missing} frames are missing and became gaps, first before frame "
        f"{frames[row]:.0f}{_in_line(row, first_line)}"
    )
    counted: npt.NDArray[np.int64] = places.astype(np.int64)
    return counted


def _stands_still(times: FloatArray, rate_hz: float | None, path: Path) -> bool:
    """Tell whether a column of times shows none while something else tells the rate; say so."""
    told = rate_hz is not None and RATES_HZ[0] <= rate_hz <= RATES_HZ[1]
    still = told and len(times) > 1 and bool((times == times[0]).all())
    if still:
        warn_of_file(
            f"{path.name}: all times are {times[0]:g} s, which tells nothing; frames are taken for "
            f"evenly spaced, {rate_hz:g} a second, as the header says"
        )
    return still


def _line_of(row: int, first_line: Lines) -> int | None:
    """Return the number of a row's line in its file; None if it has no lines."""
    if first_line is None:
        return None
    return first_line + row if isinstance(first_line, int) else first_line[row]


def _place(path: Path, row: int, first_line: Lines) -> str:
    line = _line_of(row, first_line)
    return str(path) if line is None else f"{path}:{line}"


def _in_line(row: int, first_line: Lines) -> str:
    line = _line_of(row, first_line)
    return "" if line is None else f" in line {line}"


def _show_rate(
    times: FloatArray, rows: npt.NDArray[np.int64], path: Path, first_line: Lines
) -> float | None:
    """Return frames per second of a column of times, None of a single one."""
    rounded = _find_rounding(times)
    if rounded:
        places, span = rows - rows[0], float(times[-1] - times[0])
        along = times[0] + span / places[-1] * places
        # At more frames than the steps of rounding times repeat, and rise by one step or two.
        if np.abs(times - along).max() <= rounded:
            centred = places - places.mean()
            step = float(centred @ times / (centred @ centred))
            return whole_if_near(1.0 / step, rounded / span)
    steps = np.diff(times)
    wrong = np.flatnonzero(~(steps > 0))
    if wrong.size or not np.isfinite(times[0]):
        row = int(wrong[0]) + 1 if wrong.size else 0
        before = f" after {times[row - 1]:g} s" if row else ""
        raise RecordingError(
            f"{_place(path, row, first_line)}: time is {times[row]:g} s{before}; expected "
            "rising times"
        )
    if not steps.size:
        return None
    steps = steps / np.diff(rows)
    usual = float(np.median(steps))
    uneven = np.flatnonzero(np.abs(steps - usual) > _UNEVEN * usual)
    if uneven.size:
        row = int(uneven[0]) + 1
        warn_of_file(
            f"{path.name}: {uneven.size} times do not rise evenly, first"
            f"{_in_line(row, first_line)}: {times[row]:g} s after {times[row - 1]:g} s; frames are "
            "taken for evenly spaced"
        )
        return whole_if_near(1.0 / usual)
    return whole_if_near(float((rows[-1] - rows[0]) / (times[-1] - times[0])))


def _choose_rate(said: float | None, shown: float | None, path: Path) -> float:
    """Choose between the header's rate and that of the times."""
    slowest, fastest = RATES_HZ
    odd = None if said is None or slowest <= said <= fastest else said
    said = said if odd is None else None
    shown = shown if shown is not None and slowest <= shown <= fastest else None
    if said is None and shown is None and odd is not None:
        raise RecordingError(
            f"{path}: the header has {_tell(odd)}, and no times show how many there are; expected "
            f"{slowest:g} to {fastest:g}: say it with --rate, in a recipe with read.rate_hz"
        )
    if said is None and shown is None:
        raise RecordingError(
            f"{path}: neither the header nor a column of times says how many frames there are in a "
            f"second; expected {slowest:g} to {fastest:g}: say it with --rate, in a recipe with "
            "read.rate_hz"
        )
    if odd is not None:
        warn_of_file(
            f"{path.name}: the header has {_tell(odd)}; {shown:.6g}, as the times show, is taken"
        )
    if said is None or shown is None:
        return float(said if shown is None else shown)  # type: ignore[arg-type]
    if abs(shown / said - 1.0) > _TOLERANCE:
        warn_of_file(
            f"{path.name}: the header says {said:g} frames a second and the times {shown:.6g}, "
            "which is taken"
        )
        return shown
    return said


def _tell(odd_hz: float) -> str:
    """Say what stands where the rate should."""
    return "no number where the rate stands" if np.isnan(odd_hz) else f"{odd_hz:g} frames a second"


def _find_rounding(times: FloatArray) -> float:
    """Return the step to which rising times are rounded, seconds; 0 if it is fine, or frames'."""
    if len(times) < 2 or not times[0] < times[-1] or not (np.abs(times) < _LATEST).all():
        return 0.0
    for step in _ROUNDED:
        counted = np.round(times / step)
        if np.abs(times / step - counted).max() < 1e-3:
            steps = np.diff(counted)
            return step if 0 <= steps.min() < steps.max() else 0.0
    return 0.0


def whole_if_near(rate_hz: float, uncertain: float = 0.0) -> float:
    """Return a rate without what rounding of times left of it.

    Parameters
    ----------
    rate_hz : float
    uncertain : float
        The share of it that times tell no better.
    """
    allowed = max(_WHOLE, min(uncertain, _TOLERANCE))
    # Where times tell little, cameras run at tens of frames a second rather than at others.
    for near in (10 * round(rate_hz / 10), round(rate_hz)):
        if near and abs(rate_hz / near - 1.0) < allowed:
            return float(near)
    return round(rate_hz, 6)
