"""Blocks of a task led around what they would touch, with as small a change as is found."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np
import numpy.typing as npt

from besman.motion.adapt_task import keep_block_range
from besman.motion.task_rollout import sample_task
from besman.motion.velocity_dmp import fit_velocity_weights, roll_out_velocity
from besman.records import BlockPlan, TaskPlan
from besman.records.layers import IDLE
from besman.robot.kinematics import jacobian
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.clearance import RATE_HZ, Course

FloatArray = npt.NDArray[np.float64]

# A detour is to be so far from everything; farther is no better.
_CLEAR_M = 0.01
# It is found in so many bumps at most, each the best of all on top of those before, ...
_N_BUMPS = 3
# ... of these lengths of the tool's way, or these turns of one joint, and these times at which they
# are greatest, as shares of the block.
_LENGTHS_M, _TURNS_RAD, _PEAKS = (0.05, 0.1, 0.2, 0.3), (0.2, 0.5), (0.25, 0.5, 0.75)
# How many metres of clearance a radian of change is worth.
_WORTH_M = 0.002
# The pseudo-inverse is damped where the arm is nearly singular.
_DAMPING = 0.05
# At so many places of a block a bump is judged.
_N_SAMPLES, _N_FIT = 25, 101


def free_blocks(plan: TaskPlan) -> list[int]:
    """Return which blocks lead from place to place: no straight way to or from a box, no rest."""
    borders = np.append(plan.starts_s, plan.duration)
    at_event = np.array([np.any(np.abs(plan.events_s - at) < 1e-6) for at in borders])
    return [
        k
        for k, block in enumerate(plan.blocks)
        if block.label != IDLE and not at_event[k] and not at_event[k + 1]
    ]


def lead_around(plan: TaskPlan, robot: Robot, course: Course) -> TaskPlan | None:
    """Lead blocks around what they touch; ends, borders and straight ways stay.

    The shape of a block gets smooth bumps, with the weights that make them: its joints' velocities
    at both ends stay, and what was shown is changed in the midst of it alone. Each bump moves the
    tool to one side, or turns one joint; of all those the one is taken that brings the block
    farthest from what it touches, or the smallest that brings it far enough, up to three times.

    Parameters
    ----------
    plan : TaskPlan
        As `besman.motion.grasp_goals.lead_grasps` gives it.
    robot : Robot
    course : Course
        What there is to be touched; of a whole task `Surroundings.follow` gives it.

    Returns
    -------
    TaskPlan, or None
        None if something else is touched, or no bumps free a block.
    """
    time, positions, _, _ = sample_task(plan, RATE_HZ)
    gaps = course.gaps(time, positions)
    starts = plan.starts_s
    owner = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(plan.blocks) - 1)
    free = free_blocks(plan)
    if np.any(gaps[~np.isin(owner, free)] <= 0.0):
        return None
    blocks = list(plan.blocks)
    near = {k: float(gaps[owner == k].min(initial=np.inf)) for k in free}
    # The deepest first: where that cannot be mended the others need not be.
    for k in sorted(free, key=near.__getitem__):
        if near[k] >= _CLEAR_M:
            break
        found = _lead_block(blocks[k], float(starts[k]), robot, course)
        if found is None:
            return None
        blocks[k] = found
    return replace(plan, blocks=tuple(blocks))


def _lead_block(block: BlockPlan, start_s: float, robot: Robot, course: Course) -> BlockPlan | None:
    """Lead one block around what it touches; None if it touches something in any case."""
    x = np.linspace(0.0, 1.0, _N_SAMPLES)
    clock = start_s + x * block.duration
    shape = np.zeros((len(_PEAKS), robot.n))
    rows = np.array([_bump(x, peak) for peak in _PEAKS])
    path = _roll_out(block, x)
    reached = float(_worth(course.gaps(clock, path)))
    for _ in range(_N_BUMPS):
        peaks, changes = _list_bumps(path, x, robot)
        tried = path + rows[peaks][:, :, None] * changes[:, None]
        gaps = course.gaps(np.tile(clock, len(tried)), tried.reshape(-1, robot.n))
        size = np.linalg.norm(changes, axis=1)
        worth = _worth(gaps.reshape(len(tried), -1)) - _WORTH_M * size
        best = int(worth.argmax())
        if worth[best] <= reached:
            break
        shape[peaks[best]] += changes[best]
        path, reached = tried[best], float(worth[best])
        if reached >= _CLEAR_M - _WORTH_M * size[best] - 1e-9:
            break
    if _worth(course.gaps(clock, path)) <= 0.0:
        return None
    weights = block.weights + shape.T @ _bump_weights(block.weights.shape[1])
    return keep_block_range(replace(block, weights=weights, path_error=None), robot.limits)


def _worth(gaps: FloatArray) -> FloatArray:
    """Return the least clearance along the last axis; more than what is clear is worth no more."""
    return np.asarray(np.minimum(gaps.min(axis=-1), _CLEAR_M))


def _list_bumps(
    path: FloatArray, x: FloatArray, robot: Robot
) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """List where bumps are greatest, (K,) indices of times, and what they add there, (K, n) rad."""
    listed = [list_changes(path[int(np.abs(x - peak).argmin())], robot) for peak in _PEAKS]
    peaks = [np.full(len(own), number) for number, own in enumerate(listed)]
    return np.concatenate(peaks), np.concatenate(listed)


def list_changes(posture: FloatArray, robot: Robot) -> FloatArray:
    """List changes of a posture (n,) that move its tool aside, or turn one joint, (K, n) rad."""
    sides = np.array([side for side in product((-1, 0, 1), repeat=3) if any(side)], dtype=float)
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    turns = np.concatenate([turn * np.eye(robot.n) for turn in _TURNS_RAD])
    slope = jacobian(robot.chain, posture)
    inverse = slope.T @ np.linalg.inv(slope @ slope.T + _DAMPING**2 * np.eye(6))
    ways = np.concatenate([length * sides for length in _LENGTHS_M]) @ inverse[:, :3].T
    return np.concatenate([ways, turns, -turns])


def _bump(x: FloatArray, peak: float) -> FloatArray:
    """Return a smooth bump of height 1: at rest, without acceleration, at both ends."""
    # x^a (1 - x)^b is greatest at a / (a + b).
    a, b = (3.0, 3.0 * (1.0 - peak) / peak) if peak < 0.5 else (3.0 * peak / (1.0 - peak), 3.0)
    return np.asarray((x / peak) ** a * ((1.0 - x) / (1.0 - peak)) ** b)


@lru_cache(maxsize=16)
def _bump_weights(n_weights: int) -> FloatArray:
    """Return the weights of each bump, shape (len(_PEAKS), K)."""
    x = np.linspace(0.0, 1.0, _N_FIT)
    bumps = np.stack([_bump(x, peak) for peak in _PEAKS], axis=1)
    still = np.zeros(len(_PEAKS))
    return fit_velocity_weights(x, bumps, still, still, n_weights)


def _roll_out(block: BlockPlan, x: FloatArray) -> FloatArray:
    """Return the joints at shares of a block, shape (T, n)."""
    ends = (block.start, block.goal, block.start_velocity, block.goal_velocity)
    time = x * block.duration
    return roll_out_velocity(block.weights, *ends, block.duration, np.zeros(2), time)[0]
