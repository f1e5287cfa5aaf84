"""Fit an arm's drives to what it did: simulated against logged joint paths."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from besman.robot.drives import Drives, arrive_late
from besman.robot.model import Robot
from besman.robot.mujoco_model import servo_controls
from besman.simulation.arm_alone import follow_setpoints
from besman.transfer.identification.least_squares import Estimate, estimate
from besman.transfer.identification.quantities import (
    Quantity,
    drives_with,
    quantities_of,
    values_of,
)

FloatArray = npt.NDArray[np.float64]

# Step of the simulation, and how long the arm is watched after the movement has ended.
_STEP_S = 0.002
_AFTER_S = 0.5
# A log has no more samples a second that count: the rest says the same.
_RATE_HZ = 250.0
# Encoders of arms tell no less.
_RESOLUTION_RAD = 5e-5
# Between which times after the first sample a motion may have been sent off, where nobody knows,
# and how closely that is looked for at first; what matters of it.
_EARLIEST_S, _SEARCH_S = -0.5, 0.004
_START_S = 0.002


@dataclass(frozen=True, eq=False)
class AskedMovement:
    """What was asked of the arm.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds, from 0.
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2.
    """

    time: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray


@dataclass(frozen=True, eq=False)
class ArmLog:
    """What the arm did.

    Attributes
    ----------
    movement : int
        Which of the movements it is.
    time : array, shape (T,)
        Seconds after the movement was sent off; if that is not known, after the first sample.
    positions : array, shape (T, n)
        rad.
    is_aligned : bool
        Whether it is known.
    """

    movement: int
    time: FloatArray
    positions: FloatArray
    is_aligned: bool


@dataclass(frozen=True, eq=False)
class DriveFit:
    """What logs say of an arm.

    Attributes
    ----------
    quantities : tuple of Quantity, length D
    before : array, shape (D,)
        What the arm's robot.yaml has.
    found : Estimate
        Of the quantities.
    drives : Drives
        With them.
    apart_before, apart : float
        Root mean square over samples and joints of how far simulated and logged paths are apart
        with the old and with the new values, rad.
    n_samples : int
        How many samples (of all joints) were compared.
    """

    quantities: tuple[Quantity, ...]
    before: FloatArray
    found: Estimate
    drives: Drives
    apart_before: float
    apart: float
    n_samples: int


def fit_drives(
    robot: Robot,
    movements: Sequence[AskedMovement],
    logs: Sequence[ArmLog],
    jobs: int = 1,
    progress: Callable[[float], None] = lambda share: None,
) -> DriveFit:
    """Fit gains, delays, lags, frictions and payload of an arm to logs of its movements.

    Where it is not known when a movement was sent off, that is sought as well, and delays are not.

    Parameters
    ----------
    robot : Robot
        With its tool, and what is known of its drives.
    movements : sequence of AskedMovement
    logs : sequence of ArmLog
        At least one.
    jobs : int
        Threads; they change nothing.
    progress : callable
        Called with the share done.
    """
    quantities = quantities_of(robot, any(one.is_aligned for one in logs))
    before = values_of(robot.drives, quantities)
    comparison = _Comparison(robot, movements, logs, quantities)
    starts = comparison.starts
    shifts = [Quantity("start", -1, _START_S, one - 0.3, one + 0.3) for one in starts]
    sought = (*quantities, *shifts)
    first = np.concatenate([before, starts])
    found = estimate(
        comparison.residuals,
        first,
        np.array([one.unit for one in sought]),
        (np.array([one.least for one in sought]), np.array([one.greatest for one in sought])),
        _RESOLUTION_RAD,
        jobs,
        progress,
    )
    n = len(quantities)
    mine = Estimate(found.values[:n], found.deviations[:n], found.told[:n])
    apart_before, apart = (_rms(comparison.residuals(one)) for one in (first, found.values))
    return DriveFit(
        quantities,
        before,
        mine,
        drives_with(robot.drives, quantities, mine.values),
        apart_before,
        apart,
        comparison.n_samples,
    )


class _Comparison:
    """Simulated against logged paths."""

    def __init__(
        self,
        robot: Robot,
        movements: Sequence[AskedMovement],
        logs: Sequence[ArmLog],
        quantities: Sequence[Quantity],
    ) -> None:
        self._robot, self._quantities = robot, quantities
        used = sorted({log.movement for log in logs})
        self._rows = [used.index(log.movement) for log in logs]
        asked = [movements[at] for at in used]
        self._sent = sent_setpoints(robot, asked)
        self._starts = np.stack([one.positions[0] for one in asked])
        self._clock: FloatArray = np.asarray(_STEP_S * np.arange(self._sent.shape[1]), np.float64)
        self._open = [at for at, log in enumerate(logs) if not log.is_aligned]
        pairs = [(log, asked[row]) for log, row in zip(logs, self._rows, strict=True)]
        begun = [0.0 if log.is_aligned else find_start(log, one) for log, one in pairs]
        self.starts = np.array([begun[at] for at in self._open])
        self._logs = [_thin_out(*pair, start) for pair, start in zip(pairs, begun, strict=True)]

    @property
    def n_samples(self) -> int:
        """How many samples of joints are compared."""
        return sum(log.positions.size for log in self._logs)

    def residuals(self, values: FloatArray) -> list[FloatArray]:
        """Return simulated minus logged angles (T, n) of every log, rad."""
        n = len(self._quantities)
        drives = drives_with(self._robot.drives, self._quantities, values[:n])
        setpoints = arrive_late(self._sent, drives, _STEP_S)
        paths = follow_setpoints(
            replace(self._robot, drives=drives), self._starts, setpoints, _STEP_S
        )
        begun = np.zeros(len(self._logs))
        begun[self._open] = values[n:]
        return [
            _sample(log.time - start, self._clock, paths[row]) - log.positions
            for log, start, row in zip(self._logs, begun, self._rows, strict=True)
        ]


def sent_setpoints(robot: Robot, movements: Sequence[AskedMovement]) -> FloatArray:
    """Return what is sent to the servos (B, T, n) at the simulation's steps, and then at rest."""
    longest = max(one.time[-1] for one in movements) + _AFTER_S
    n_steps = int(np.ceil(longest / _STEP_S)) + 1
    clock = np.asarray(_STEP_S * np.arange(n_steps), dtype=np.float64)
    parts = [
        np.stack([_sample(clock, one.time, getattr(one, name)) for one in movements])
        for name in ("positions", "velocities", "accelerations")
    ]
    return servo_controls(robot, *parts)


def find_start(log: ArmLog, movement: AskedMovement) -> float:
    """Return after which time of a log, seconds, a movement seems to have been sent off."""
    every = max(int(_SEARCH_S / np.median(np.diff(log.time))), 1)
    time, positions = log.time[::every], log.positions[::every]
    lasts = movement.time[-1]
    tried = np.arange(_EARLIEST_S, max(time[-1] - 0.8 * lasts, 0.0) + _SEARCH_S, _SEARCH_S)
    apart = np.full(len(tried), np.inf)
    first = np.searchsorted(time, tried, side="left")
    end = np.searchsorted(time, tried + lasts, side="right")
    for row, start in enumerate(tried):
        # Of an hour's log only what is looked at is touched.
        inside = slice(int(first[row]), int(end[row]))
        if end[row] - first[row] > 1:
            asked = _sample(time[inside] - start, movement.time, movement.positions)
            apart[row] = np.square(asked - positions[inside]).mean()
    return float(tried[int(np.argmin(apart))])


def _thin_out(log: ArmLog, movement: AskedMovement, start: float) -> ArmLog:
    """Leave out what comes too often, and what the arm did before and after."""
    every = max(int((len(log.time) - 1) / ((log.time[-1] - log.time[0]) * _RATE_HZ)), 1)
    rows = np.arange(0, len(log.time), every)
    time = log.time[rows] - start
    rows = rows[(time >= 0.0) & (time <= movement.time[-1] + _AFTER_S)]
    return replace(log, time=log.time[rows], positions=log.positions[rows])


def _sample(at: FloatArray, time: FloatArray, values: FloatArray) -> FloatArray:
    """Return values (T, n) at other times, on straight lines; before and after as at the ends."""
    return np.column_stack([np.interp(at, time, column) for column in values.T])


def _rms(series: Sequence[FloatArray]) -> float:
    return float(np.sqrt(np.mean(np.concatenate([one.ravel() for one in series]) ** 2)))
