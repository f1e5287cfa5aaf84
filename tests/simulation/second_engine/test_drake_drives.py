"""An arm whose servos and joints are not ideal does in Drake what it does in MuJoCo."""

from dataclasses import replace

import numpy as np
import pytest

from besman.robot.model import load_robot
from besman.robot.mujoco_model import servo_controls
from besman.simulation.arm_alone import follow_setpoints
from besman.simulation.second_engine.drake_run import run_drake
from besman.simulation.second_engine.drake_scene import DrakeScene

pytest.importorskip("pydrake", reason="the extra verify is not installed")

STEP_S, N_STEPS = 0.002, 250
ROBOT = load_robot("ur5", "stick_holder")
ONES = np.ones(6)


def follow_in_drake(robot, start, setpoints):
    """Return joint angles (T, n), rad."""
    scene = DrakeScene(robot, STEP_S, 0.1)
    scene.finish()

    def look(context):
        angles = scene.plant.GetPositions(context, scene.arm)
        return angles, scene.plant.GetVelocities(context, scene.arm), np.empty(0)

    run = run_drake(scene, start, setpoints, lambda *_: np.zeros(1, dtype=bool), look)
    return np.concatenate([start[None], run.qpos[0, :-1]])


@pytest.mark.parametrize(
    "drives",
    [
        {"gains": 0.6 * ONES},
        {"damping": ROBOT.limits.torque / ROBOT.limits.velocity * 0.1},
        {"friction": ROBOT.limits.torque * 0.05},
        {"payload": 2.0},
    ],
)
def test_drives_do_the_same_in_both_engines(drives):
    time = STEP_S * np.arange(N_STEPS)
    phase = 2 * np.pi * time[:, None] / time[-1]
    swing = 0.3 * np.linspace(1.0, 0.5, 6)
    positions = ROBOT.home + swing * (1 - np.cos(phase))
    rate = 2 * np.pi / time[-1]
    velocities = swing * rate * np.sin(phase)
    setpoints = servo_controls(ROBOT, positions, velocities, swing * rate**2 * np.cos(phase))
    start = positions[0]

    def follow(robot):
        mujoco = follow_setpoints(robot, start[None], setpoints[None], STEP_S)[0]
        return mujoco, follow_in_drake(robot, start, setpoints)

    other = replace(ROBOT, drives=replace(ROBOT.drives, **drives))
    # Drake's servos are a step later, so that what drives do is held against ideal ones.
    mujoco, drake = (one - ideal for one, ideal in zip(follow(other), follow(ROBOT), strict=True))
    largest = np.abs(mujoco).max(axis=0)
    assert largest.max() > 1.5e-3
    assert np.abs(largest - np.abs(drake).max(axis=0)).max() < 0.15 * largest.max()
    # Where a joint turns round, a friction changes its side a step later.
    assert np.median(np.abs(mujoco - drake)) < 0.1 * largest.max()
