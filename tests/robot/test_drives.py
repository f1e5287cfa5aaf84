"""Servos and joints that are not ideal, and what the arm carries."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import yaml

from besman.exceptions import ConfigError
from besman.robot.drives import arrive_late, delay_and_smooth
from besman.robot.dynamics import body_inertias, true_inertias
from besman.robot.model import find_robot, load_robot
from besman.robot.mujoco_model import arm_spec, servo_gains
from besman.simulation.perturbation import Perturbation, perturb_model

ROBOT = load_robot("ur5", "gripper")
ONES = np.ones(6)


def with_drives(**values):
    return replace(ROBOT, drives=replace(ROBOT.drives, **values))


def write_robot(path, joint=(), **keys):
    """Write the UR5 under another name, its first joint and itself changed."""
    content = yaml.safe_load(find_robot("ur5").read_text()) | {"name": "mine"} | keys
    content["joints"][0] |= dict(joint)
    path.write_text(yaml.safe_dump(content))
    return path


def test_a_robot_yaml_says_what_servos_and_joints_do(tmp_path):
    joint = {
        "servo_gain": 0.8, "delay_s": 0.01, "lag_s": 0.1, "friction_nm": 2.0, "damping_nms_rad": 3.0
    }  # fmt: skip
    robot = load_robot(write_robot(tmp_path / "mine.yaml", joint, payload_kg=0.2), "gripper")
    drives = robot.drives
    found = [drives.gains, drives.delays, drives.lags, drives.friction, drives.damping]
    assert [one[0] for one in found] == list(joint.values())
    assert [one[1] for one in found] == [1.0, 0.0, 0.0, 0.0, 0.0]
    assert drives.payload == 0.2
    assert drives.are_late
    assert not ROBOT.drives.are_late


@pytest.mark.parametrize(
    ("joint", "keys", "message"),
    [
        ({"servo_gain": 0}, {}, "servo_gain"),
        ({"delay_s": -0.1}, {}, "delay_s"),
        ({"friction_nm": -1}, {}, "friction_nm"),
        ({}, {"payload_kg": -1.0}, "payload_kg: got -1"),
    ],
)
def test_what_no_drive_does_is_refused(tmp_path, joint, keys, message):
    with pytest.raises(ConfigError, match=message):
        load_robot(write_robot(tmp_path / "mine.yaml", joint, **keys), "gripper")


def test_the_model_is_that_of_a_perturbed_world():
    """Two ways to the same model: the robot's drives, and a perturbation of ideal ones."""
    gains, friction, damping = 0.8 * ONES, np.arange(6.0), 2.0 * ONES
    mine = arm_spec(with_drives(gains=gains, friction=friction, damping=damping), 0.002)[0]
    world = Perturbation(
        friction=1.0, object_mass=1.0, link_masses=ONES, servo_gains=gains, joint_friction=friction,
        joint_damping=damping, delays=0 * ONES, lags=0 * ONES, backlash=0 * ONES, offsets=0 * ONES,
    )  # fmt: skip
    other = perturb_model(arm_spec(ROBOT, 0.002)[0].compile(), world)
    mine = mine.compile()
    for name in ("dof_frictionloss", "dof_damping", "actuator_gainprm", "actuator_biasprm"):
        np.testing.assert_allclose(getattr(mine, name), getattr(other, name))
    np.testing.assert_allclose(mine.actuator_gainprm[:, 0], 0.8 * servo_gains(ROBOT).kp)


def test_a_payload_is_a_mass_in_the_middle_of_the_tool():
    """The same forces as of a body that is welded there."""
    spec, last = arm_spec(ROBOT, 0.002)
    middle = ROBOT.tool.capsule_ends.mean(axis=0)
    flange = ROBOT.chain.tip @ np.linalg.inv(ROBOT.tool.tcp2flange)
    place = flange[:3, :3] @ middle + flange[:3, 3]
    point = {"mass": 1.5, "ipos": [0.0] * 3, "inertia": [1e-9] * 3, "explicitinertial": True}
    last.add_body(pos=place, **point)
    models = spec.compile(), arm_spec(with_drives(payload=1.5), 0.002)[0].compile()
    random = np.random.default_rng(0)
    state = random.normal(size=(3, 6))
    torques = []
    for model in models:
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:], data.qacc[:] = state
        mujoco.mj_inverse(model, data)
        torques.append(data.qfrc_inverse.copy())
    np.testing.assert_allclose(*torques, atol=1e-6)
    without = true_inertias(with_drives(payload=0.0))
    np.testing.assert_array_equal(without.masses, body_inertias(ROBOT).masses)


def test_a_delay_shifts_and_a_lag_smooths():
    time = 0.002 * np.arange(400)
    ramp = 2.0 * time
    np.testing.assert_allclose(delay_and_smooth(ramp, 0.01, 0.0, 0.002)[5:], ramp[5:] - 0.02)
    # A first-order lag is behind a ramp by its time constant, once it has settled.
    late = delay_and_smooth(ramp, 0.0, 0.05, 0.002)
    assert ramp[-1] - late[-1] == pytest.approx(2.0 * 0.05, rel=0.03)
    assert late[0] == ramp[0]
    batch = np.stack([np.column_stack([ramp] * 6)] * 2)
    delays = with_drives(delays=0.01 * np.arange(6)).drives
    np.testing.assert_allclose(
        arrive_late(batch, delays, 0.002)[1, -1], ramp[-1] - 0.02 * np.arange(6)
    )
    assert arrive_late(batch, ROBOT.drives, 0.002) is batch
