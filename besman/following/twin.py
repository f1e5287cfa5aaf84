"""An arm that is where a person's hand is, within its limits at every millisecond."""

from __future__ import annotations

import numpy as np

from besman.exceptions import BesmanError, RobotError
from besman.following.hand_placement import HandPlacement
from besman.motion.safe_setpoints import SafeSetPoints, SetPoints
from besman.records import FloatArray
from besman.robot.branches import follow_all
from besman.robot.clearance import move_clear
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot

_ROUNDS, _TOLERANCE = 20, 1e-8
# How long the filter of what the hand asks of the joints remembers, seconds.
_MEMORY_S = 0.02
# Where the hand asks the arm to touch itself, its pedestal or the floor, it stays so far off.
_CLEARANCE_M = 0.02
# Of a joint's greatest speed: no faster is the way to what the hand asks for.
_FASTEST = 2.0


class JointFilter:
    """Tells place and speed of joints from noisy places, without looking ahead.

    A critically damped g-h filter [1]_, equations (1.2-11) and (1.2-16).

    Parameters
    ----------
    memory_s : float
        After so long a sighting counts by 1/e.

    References
    ----------
    .. [1] E. Brookner: Tracking and Kalman filtering made easy, Wiley 1998.
    """

    def __init__(self, memory_s: float) -> None:
        self._memory_s = memory_s
        self._positions: FloatArray | None = None

    def update(self, positions: FloatArray, step_s: float) -> tuple[FloatArray, FloatArray]:
        """Take where joints are, shape (n,), a time after the last; return place and speed."""
        before = self._positions
        if before is None:
            self._positions, self._velocities = positions, np.zeros(len(positions))
            return self._positions, self._velocities
        kept = float(np.exp(-step_s / self._memory_s))
        expected = before + self._velocities * step_s
        off = positions - expected
        self._positions = expected + (1.0 - kept**2) * off
        self._velocities = self._velocities + (1.0 - kept) ** 2 * off / step_s
        return self._positions, self._velocities


class Twin:
    """Takes poses of a hand as they come; gives set-points.

    Parameters
    ----------
    robot : Robot
    placement : HandPlacement
    hand2back : array, shape (4, 4)
        Where the hand is: the arm begins at rest there.
    hold_s : float
        See `besman.motion.safe_setpoints.SafeSetPoints`.

    Attributes
    ----------
    target : array, shape (4, 4)
        What the hand asked of the tool centre point last, in the arm's world, metres.

    Raises
    ------
    RobotError
        If the arm cannot rest at any of its configurations there.
    """

    def __init__(
        self, robot: Robot, placement: HandPlacement, hand2back: FloatArray, hold_s: float = 0.06
    ) -> None:
        self._robot, self._placement = robot, placement
        self.target = placement.apply(hand2back)
        self._filter = JointFilter(_MEMORY_S)
        self._setpoints, self._solution = self._begin(hold_s)

    @property
    def positions(self) -> FloatArray:
        """Where the joints are sent at the moment, shape (n,), rad."""
        found: FloatArray = self._setpoints.now.positions[0]
        return found

    @property
    def rests(self) -> bool:
        """Whether the arm stands still until it is aimed again."""
        return self._setpoints.rests

    @property
    def away_m(self) -> float:
        """How far the tool centre point is from what the hand asked for last."""
        tip = forward_kinematics(self._robot.chain, self.positions[None])[0]
        return float(np.linalg.norm(tip[:3, 3] - self.target[:3, 3]))

    def follow(self, hand2back: FloatArray, step_s: float) -> bool:
        """Aim at a pose of the hand, a time after the last one.

        Returns
        -------
        bool
            Whether the arm is on its way there; otherwise it comes to rest.
        """
        self.target = self._placement.apply(hand2back)
        self._seek(step_s)
        positions, velocities = self._filter.update(self._solution, step_s)
        if self._setpoints.aim(positions, velocities):
            return True
        if self._setpoints.rests:
            # What is wanted has gone round something, or was hidden while it did, and no straight
            # way leads there any more: it is sought anew from where the arm has come to rest.
            self._solution, self._filter = self.positions, JointFilter(_MEMORY_S)
        return False

    def advance(self, n: int) -> SetPoints:
        """Give the set-points of the next n milliseconds."""
        return self._setpoints.advance(n)

    def _seek(self, step_s: float) -> None:
        """Bring the joints that are wanted nearer to what the hand asks for.

        In small steps, so that the arm slides along what it must not touch, and is never sought on
        the other side of it.
        """
        wish = self._solve(self._solution[None])[0][0] - self._solution
        longest = _FASTEST * step_s * self._robot.limits.velocity
        step = wish / max(1.0, float(np.max(np.abs(wish) / longest)))
        self._solution = move_clear(self._robot, self._solution + step, _CLEARANCE_M)

    def _solve(self, starts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return joint angles (K, n) for the target from each start, and their costs (K,)."""
        ik = self._placement.ik
        paths, errors = follow_all(
            self._robot,
            self.target[None, None],
            starts,
            0,
            ik,
            self._placement.free_spin,
            rounds=_ROUNDS if len(starts) == 1 else 5 * _ROUNDS,
            tolerance=_TOLERANCE,
        )
        off = errors[0, :, 0] * [ik.position, ik.orientation]
        return paths[0, :, 0], np.linalg.norm(off, axis=1)

    def _begin(self, hold_s: float) -> tuple[SafeSetPoints, FloatArray]:
        """Rest at the best configuration in which the arm can."""
        found, costs = self._solve(np.vstack([self._placement.starts, self._robot.home]))
        problem: BesmanError | None = None
        for row in np.argsort(costs, kind="stable"):
            try:
                return SafeSetPoints(self._robot, found[row], hold_s), found[row]
            except RobotError as error:
                problem = problem or error
        assert problem is not None
        raise problem
