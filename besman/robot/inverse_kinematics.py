"""Inverse kinematics of whole paths: the branches with the least total cost, without jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import RobotError
from besman.robot.branch_choice import Gaps, choose_candidates, rate_paths
from besman.robot.branches import (
    SAME_BRANCH_RAD,
    IkWeights,
    draw_starts,
    find_branches,
    follow_all,
    is_new,
    joint_box,
)
from besman.robot.model import Robot
from besman.robot.path_refinement import refine_path

__all__ = [
    "Gaps",
    "IkPath",
    "IkWeights",
    "draw_starts",
    "find_branches",
    "follow_all",
    "joint_box",
    "solve_path",
]

FloatArray = npt.NDArray[np.float64]

# All candidates are refined by so many rounds, and so many that differ to the end: of five arms' 80
# paths the one that is best in the end is among them but for a share of 2e-3 of its cost at most.
_LOOK_ROUNDS, _ROUNDS, _FINALISTS = 8, 60, 3
# Home only settles what a whole path leaves open: less than for a pose alone.
_HOME_SHARE = 0.1
_WEIGHTS = IkWeights()


@dataclass(frozen=True, eq=False)
class IkPath:
    """The answer for one path of T poses.

    Attributes
    ----------
    positions : array, shape (T, n)
        Joint angles, rad.
    position_error, orientation_error : array, shape (T,)
        Metres and radians between the poses asked for and those reached.
    cost : float
        What the sequences of branches were compared by.
    """

    positions: FloatArray
    position_error: FloatArray
    orientation_error: FloatArray
    cost: float


def solve_path(
    robot: Robot,
    poses: FloatArray,
    *,
    weights: IkWeights = _WEIGHTS,
    free_spin: bool = False,
    step_s: float | None = None,
    seed: int = 0,
    gaps: Gaps | None = None,
) -> IkPath:
    """Find joint angles that follow a path of poses.

    Sequences of branches over the whole path are chosen by dynamic programming: of an arm built
    like the UR series from all its branches in closed form; of others, and where that arm cannot
    reach a pose, from branches followed from several poses, so that the path may change from one
    to another where they come near. The best are refined as a whole, which settles what the poses
    leave open and what no branch can reach, and the cheapest is kept.

    Parameters
    ----------
    robot : Robot
        The arm with its tool.
    poses : array, shape (T, 4, 4)
        Poses of the tool centre point in the robot's world frame, metres.
    weights : IkWeights
        Position before orientation.
    free_spin : bool
        The rotation about the tool's z axis does not matter.
    step_s : float, optional
        Seconds between poses; with it, branches that need less time are preferred.
    seed : int
        Of the drawn configurations.
    gaps : callable, optional
        How far the arm is from what it must not touch besides itself and the floor: branches that
        stay clear of that are preferred.

    Returns
    -------
    IkPath

    Raises
    ------
    RobotError
        If the poses have the wrong shape or are not finite.
    """
    targets = _check(poses)
    starts = choose_candidates(robot, targets, weights, free_spin, step_s, seed, gaps)

    def refined(start: FloatArray, path: FloatArray, rounds: int) -> IkPath:
        positions, errors = refine_path(
            robot.chain,
            targets,
            path,
            joint_box(robot),
            weights.as_array() * [1.0, 1.0, _HOME_SHARE],
            robot.home,
            free_spin,
            _paces(robot, start, step_s),
            pace_of=start,
            rounds=rounds,
        )
        cost = float(rate_paths(robot, positions[None], errors[None], weights, step_s, gaps)[0])
        return IkPath(positions, errors[:, 0], errors[:, 1], cost)

    looks = [(start, refined(start, start, _LOOK_ROUNDS)) for start in starts]
    looks.sort(key=lambda look: look[1].cost)
    kept: list[tuple[FloatArray, FloatArray]] = []
    for start, look in looks:
        if is_new(look.positions, [path for _, path in kept], SAME_BRANCH_RAD):
            kept.append((start, look.positions))
    ends = [refined(start, path, _ROUNDS) for start, path in kept[:_FINALISTS]]
    return min(ends, key=lambda end: end.cost)


def _paces(
    robot: Robot, positions: FloatArray, step_s: float | None
) -> tuple[FloatArray, FloatArray]:
    """Return first and second differences at the limits; without a time at the path's own pace."""
    if step_s is None:
        steps = np.abs(np.diff(positions, axis=0)) / robot.limits.velocity
        step_s = max(float(np.percentile(steps, 90)), 1e-3) if len(steps) else 1.0
    return robot.limits.velocity * step_s, robot.limits.acceleration * step_s**2


def _check(poses: FloatArray) -> FloatArray:
    """Check the shape of a path of poses."""
    targets = np.ascontiguousarray(poses, dtype=np.float64)
    if targets.ndim != 3 or targets.shape[1:] != (4, 4) or len(targets) == 0:
        raise RobotError(f"poses must have shape (T, 4, 4) with T above 0, got {targets.shape}")
    if not np.all(np.isfinite(targets)):
        raise RobotError("poses must be finite, got NaN or infinity")
    return targets
