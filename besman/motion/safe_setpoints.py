"""Set-points for an arm that is to be where somebody moves to, of whom nobody knows the next step.

Every plan ends at rest, and is checked in all its samples, the way to rest too, before it is put in
force. Where no plan can be, the one before is carried on, which ends at rest as well: so there is
never a sample that was not checked (a failsafe trajectory [1]_). How to get there in
the least time within limits of speed, acceleration and jerk is the library ruckig's [2]_.

References
----------
.. [1] C. Pek, M. Althoff: Fail-safe motion planning for online verification of autonomous vehicles
   using convex optimization, IEEE T-RO 37 (3), 2021. doi:10.1109/TRO.2020.3036624
.. [2] L. Berscheid, T. Kroeger: Jerk-limited real-time trajectory generation with arbitrary target
   states, RSS 2021. doi:10.15607/RSS.2021.XVII.015
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from besman.exceptions import RobotError, why_not_there
from besman.records import FloatArray
from besman.robot.limits import RATE_HZ, check_limits
from besman.robot.model import Robot

# Where a robot states no limit of its jerk, so much time passes between none and all of the
# acceleration, seconds; and no more than so much of each limit is asked for: rounding is no reason.
_RISE_S = 0.04
_SHARE = 0.999
# Of speed and acceleration, tried one after the other where a plan asks for too much torque or
# comes too near to something.
_PACES = (1.0, 0.6, 0.3)


class SetPoints(NamedTuple):
    """Samples of a movement at 1 kHz.

    Attributes
    ----------
    positions, velocities, accelerations : array, shape (K, n)
        rad, rad/s, rad/s^2.
    """

    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray


class SafeSetPoints:
    """Gives set-points at 1 kHz that stay within all limits of an arm.

    Limits are those of `besman.robot.limits.check_limits`: position, speed, acceleration, torque,
    jerk where the robot states one, and distance from itself, its pedestal and the floor.

    Parameters
    ----------
    robot : Robot
    start : array, shape (n,)
        Where it rests, rad.
    hold_s : float
        For so long a plan goes on towards its target; what is not aimed at again by then comes to
        rest.

    Raises
    ------
    RobotError
        If ruckig is not installed, or the arm cannot rest there.
    """

    def __init__(self, robot: Robot, start: FloatArray, hold_s: float = 0.06) -> None:
        try:
            import ruckig
        except ImportError as error:
            reason = why_not_there(error, "ruckig", "besman[mirror]")
            raise RobotError(f"besman mirror: {reason}") from None
        self._ruckig, self._robot = ruckig, robot
        self._held = _milliseconds(round(hold_s * RATE_HZ))
        limits = robot.limits
        self._jerk = np.minimum(_SHARE * limits.jerk, limits.acceleration / _RISE_S)
        still = np.zeros((1, robot.n))
        self._plan = SetPoints(np.array(start, dtype=np.float64)[None], still, still)
        self._at = 0
        report = check_limits(robot, *self._plan)
        if not report.kept:
            raise RobotError(
                f"{robot.name}: cannot rest at {np.round(start, 2).tolist()} rad: it is "
                f"{report.least_distance:.3f} m from itself or the floor, beyond a joint's range, "
                "or too weak there"
            )

    @property
    def now(self) -> SetPoints:
        """The last sample that was given, shapes (1, n)."""
        return self._samples(self._at, self._at + 1)

    @property
    def rests(self) -> bool:
        """Whether the plan in force is at its end."""
        return self._at >= len(self._plan.positions) - 1

    def aim(self, positions: FloatArray, velocities: FloatArray) -> bool:
        """Plan anew from the last sample that was given.

        Parameters
        ----------
        positions, velocities : array, shape (n,)
            Where the target is and how it moves, rad and rad/s; what is beyond the limits is cut
            to them.

        Returns
        -------
        bool
            Whether there is a plan towards it; without one the plan before stays in force.
        """
        limits = self._robot.limits
        goal = np.clip(positions, limits.position_min, limits.position_max)
        # While the plan goes on the target stays within the range too.
        room = (limits.position_min - goal, limits.position_max - goal)
        velocities = np.clip(velocities, *(one / self._held[-1] for one in room))
        for pace in _PACES:
            plan = self._make_plan(goal, velocities, pace)
            if plan is not None and check_limits(self._robot, *plan).kept:
                self._plan, self._at = plan, 0
                return True
        return False

    def advance(self, n: int) -> SetPoints:
        """Give the next n samples; at the end of the plan the arm rests."""
        given = self._samples(self._at + 1, self._at + 1 + n)
        self._at += n
        return given

    def _samples(self, start: int, stop: int) -> SetPoints:
        """Return samples of the plan in force; after its end it is at rest."""
        rows = np.minimum(np.arange(start, stop), len(self._plan.positions) - 1)
        return SetPoints(*(part[rows] for part in self._plan))

    def _make_plan(self, goal: FloatArray, moving: FloatArray, pace: float) -> SetPoints | None:
        """Return a plan from now on, which begins with the sample that was given last."""
        limits = self._robot.limits
        speed, pull = pace * _SHARE * limits.velocity, pace * _SHARE * limits.acceleration
        moving = np.clip(moving, -0.95 * speed, 0.95 * speed)
        # As seen from the target, which moves evenly: so that it is met, and not where it was.
        begin, still = self.now, np.zeros(self._robot.n)
        there = self._ruckig.InputParameter(self._robot.n)
        there.min_velocity = -speed - moving
        there.target_position, there.target_velocity = still, still
        seen = SetPoints(begin.positions - goal, begin.velocities - moving, begin.accelerations)
        way = self._solve(there, seen, speed - moving, pull)
        if way is None:
            return None
        going = _sample(way, self._held)
        passed = goal + np.outer(self._held, moving)
        going = SetPoints(going.positions + passed, going.velocities + moving, going.accelerations)
        stop = self._ruckig.InputParameter(self._robot.n)
        stop.control_interface = self._ruckig.ControlInterface.Velocity
        last = SetPoints(*(part[-1:] for part in going))
        way = self._solve(stop, last, _SHARE * limits.velocity, _SHARE * limits.acceleration)
        if way is None:
            return None
        braking = _sample(way, _milliseconds(int(np.ceil(way.duration * RATE_HZ)) + 1))
        parts = [np.concatenate(three) for three in zip(begin, going, braking, strict=True)]
        # At rest it rests: what rounding leaves would drift.
        parts[1][-1] = parts[2][-1] = 0.0
        return SetPoints(*parts)

    def _solve(
        self, wanted: Any, begin: SetPoints, speed: FloatArray, pull: FloatArray
    ) -> Any | None:
        """Return ruckig's trajectory; None if it finds none."""
        wanted.current_position, wanted.current_velocity, wanted.current_acceleration = (
            part[0] for part in begin
        )
        wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = speed, pull, self._jerk
        wanted.synchronization = self._ruckig.Synchronization.No
        way = self._ruckig.Trajectory(self._robot.n)
        try:
            result = self._ruckig.Ruckig(self._robot.n).calculate(wanted, way)
        except (self._ruckig.RuckigError, RuntimeError):
            # It says so of states that rounding has put beyond a limit: the plan before is kept.
            return None
        found = result in (self._ruckig.Result.Working, self._ruckig.Result.Finished)
        return way if found else None


def _milliseconds(n: int) -> FloatArray:
    """Return the times of the next n samples, seconds."""
    times: FloatArray = np.arange(1, n + 1) / RATE_HZ
    return times


def _sample(way: Any, times: FloatArray) -> SetPoints:
    """Return a trajectory of ruckig's at some times, shape (K,), seconds."""
    positions, velocities, accelerations = zip(*map(way.at_time, times.tolist()), strict=True)
    return SetPoints(np.array(positions), np.array(velocities), np.array(accelerations))
