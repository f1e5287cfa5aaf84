"""The joint movement of a whole task: chained primitives on one clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from besman.motion.velocity_dmp import roll_out_velocity
from besman.records import TaskPlan

FloatArray = npt.NDArray[np.float64]


def sample_task(
    plan: TaskPlan, rate_hz: float = 1000.0
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Roll out all blocks of a task at equal steps from its start to just past its end.

    Parameters
    ----------
    plan : TaskPlan
    rate_hz : float
        Samples per second.

    Returns
    -------
    time : array, shape (T,)
        Seconds.
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2; continuous through all borders, and at rest at both ends.
    """
    time = np.arange(int(np.ceil(plan.duration * rate_hz - 1e-9)) + 1) / rate_hz
    starts = plan.starts_s
    owner = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(plan.blocks) - 1)
    moved = [np.empty((len(time), len(plan.joint_names))) for _ in range(3)]
    for k, block in enumerate(plan.blocks):
        rows = np.flatnonzero(owner == k)
        if len(rows):
            parts = roll_out_velocity(
                block.weights,
                block.start,
                block.goal,
                block.start_velocity,
                block.goal_velocity,
                block.duration,
                np.zeros(2),
                time[rows] - starts[k],
            )
            for whole, part in zip(moved, parts, strict=True):
                whole[rows] = part
    positions, velocities, accelerations = moved
    return time, positions, velocities, accelerations


def stretch_task(plan: TaskPlan, factor: float) -> TaskPlan:
    """Make a task slower or faster, evenly: the same path, and its events with it.

    Parameters
    ----------
    plan : TaskPlan
    factor : float
        New duration over the old one.
    """
    blocks = tuple(
        replace(
            block,
            duration=block.duration * factor,
            start_velocity=block.start_velocity / factor,
            goal_velocity=block.goal_velocity / factor,
        )
        for block in plan.blocks
    )
    return replace(plan, blocks=blocks, events_s=plan.events_s * factor)
