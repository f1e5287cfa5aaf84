"""Loaded in a process that others are forked from: they have what a throw takes when it is tried.

That is kernels from Numba's cache, an arm, its scene, the perturbed models of it, for whoever
refines as it is by default; others have the kernels.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from besman.exceptions import RobotError
from besman.records import MotionPlan
from besman.robot.model import Robot, load_robot
from besman.simulation.tasks.kinds import load_task
from besman.stages.refine.robustness import RobustConfig
from besman.stages.refine.search_loop import try_in_worlds

_N_WEIGHTS = 20
# So short that what is tried takes no time.
_DURATION_S = 0.1
_TURN_RAD = 0.01


def rehearse() -> Robot:
    """Try a movement that throws nothing; return the arm, as processes get it that are sent it."""
    make, what_of = load_robot("ur5", "stick_holder").__reduce__()
    robot: Robot = make(*what_of)
    plan = MotionPlan(
        weights=np.zeros((robot.n, _N_WEIGHTS)),
        start=robot.home,
        goal=robot.home + _TURN_RAD,
        duration=_DURATION_S,
        joint_names=robot.joint_names,
        rmse=0.0,
        goal_pose=np.zeros(7),
        target=np.zeros(3),
        name="rehearsal",
        label="",
    )
    try_in_worlds(robot, load_task("stick_throw"), [plan], RobustConfig().draw(robot))
    return robot


# Why an arm cannot be loaded says the process that needs one.
with suppress(RobotError):
    rehearse()
