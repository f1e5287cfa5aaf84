"""How an arm stands of which nobody says it."""

import numpy as np
import pinocchio
import pytest

from besman.robot.collision import distances
from besman.robot.config import CapsuleConfig, RobotConfig
from besman.robot.files.standing import (
    arm_reach,
    assume_mounting,
    base_offset,
    find_home,
    flange_rotation,
)
from besman.robot.kinematics import forward_kinematics, manipulability
from besman.robot.model import load_robot


@pytest.mark.parametrize("name", ["ur5", "iiwa7", "compi"])
def test_the_reach_is_no_less_than_what_random_poses_reach(name):
    robot = load_robot(name, "none")
    tip = "tool0" if name == "ur5" else "flange" if name == "compi" else None
    tip = tip or robot.model.frames[robot.model.frames[robot.tip_frame].parentFrame].name
    reach, shoulder = arm_reach(robot.model, tip)
    assert shoulder > robot.base_height
    limits = robot.limits
    poses = np.random.default_rng(0).uniform(
        limits.position_min, limits.position_max, (2000, robot.n)
    )
    place = robot.chain.placements[0] @ robot.chain.placements[1]
    way = forward_kinematics(robot.chain, poses)[:, :3, 3] - place[:3, 3]
    farthest = np.linalg.norm(way, axis=1).max()
    assert farthest <= reach + 1e-9
    assert farthest > 0.7 * reach


def test_a_small_arm_stands_as_high_as_it_is_long_and_a_tall_one_on_the_floor():
    small = assume_mounting(0.4, 0.1)
    assert small["height_m"] == pytest.approx(0.3)
    assert 0 < small["pedestal_radius_m"] < 0.05
    nothing = {"height_m": 0, "yaw_deg": 0, "pedestal_radius_m": 0}
    assert assume_mounting(1.3, 1.2) == nothing
    # A mobile robot stands on the floor; an arm on a rail, on what that stands on.
    assert assume_mounting(1.1, 0.7, has_base=True) == nothing
    assert assume_mounting(1.1, 0.2, has_base=True)["height_m"] == 0.9
    assert assume_mounting(3.0, 0.6)["height_m"] == pytest.approx(0.5)
    radius = assume_mounting(1.1, 0.2)["pedestal_radius_m"]
    assert assume_mounting(1.1, 0.2, beside_m=0.99 * radius)["pedestal_radius_m"] == radius
    assert assume_mounting(1.1, 0.2, beside_m=1.01 * radius)["pedestal_radius_m"] == 0.0


@pytest.mark.parametrize("name", ["ur5", "iiwa7"])
def test_home_is_clear_within_limits_and_far_from_singular(name, all_poses):
    robot = load_robot(name, "none")
    home, is_clear = find_home(robot, 0.9)
    assert is_clear
    assert distances(robot.chain, home).min() > 0
    assert np.all((home > robot.limits.position_min) & (home < robot.limits.position_max))
    random = np.random.default_rng(1)
    poses = random.uniform(robot.limits.position_min, robot.limits.position_max, (500, robot.n))
    assert manipulability(robot.chain, home) > np.median(manipulability(robot.chain, poses))
    tip = forward_kinematics(robot.chain, home)
    assert tip[0, 3] > 0.25
    assert tip[0, 2] > 0.8
    np.testing.assert_array_equal(home, find_home(robot, 0.9)[0])


def arm_with_flange(rotation, offset):
    model = pinocchio.Model()
    joint = model.addJoint(0, pinocchio.JointModelRY(), pinocchio.SE3.Identity(), "a")
    place = pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, 0.3]))
    joint = model.addJoint(joint, pinocchio.JointModelRZ(), place, "b")
    pose = pinocchio.SE3(rotation, np.array(offset))
    model.addFrame(pinocchio.Frame("tip", joint, 0, pose, pinocchio.FrameType.BODY))
    return model


@pytest.mark.parametrize("outwards", [0.1, -0.1])
@pytest.mark.parametrize("turn", [(0, 0, 0), (0, 90, 0), (0, -90, 0), (90, 0, 0), (180, 0, 0)])
def test_the_flange_points_away_along_the_last_axis(outwards, turn):
    rotation = pinocchio.rpy.rpyToMatrix(*np.radians(turn))
    quaternion, note = flange_rotation(arm_with_flange(rotation, [0, 0, outwards]), "tip")
    w, x, y, z = quaternion
    placed = rotation @ pinocchio.Quaternion(w, x, y, z).matrix()
    np.testing.assert_allclose(placed[:, 2], [0, 0, np.sign(outwards)], atol=1e-9)
    assert (note == "") == (abs(rotation[2, 2] - np.sign(outwards)) < 1e-9)


def test_a_flange_askew_is_left_as_it_is():
    rotation = pinocchio.rpy.rpyToMatrix(0.0, 0.6, 0.0)
    quaternion, note = flange_rotation(arm_with_flange(rotation, [0, 0, 0.1]), "tip")
    assert (quaternion.tolist(), note) == ([1, 0, 0, 0], "")


@pytest.mark.parametrize(
    ("capsules", "beside"),
    [
        ([], 0.0),
        # The base at 0.5 m counts, not what turns on it; the first link does where it has no shape.
        ([("base_link", [[0.3, 0.4, 0.0]] * 2), ("shoulder_link", [[0.0] * 3] * 2)], 0.4),
        ([("shoulder_link", [[0.0, 0.0, -0.3], [0.0, 0.0, 0.3]])], 0.0),
        ([("forearm_link", [[0.0] * 3] * 2)], 0.0),
    ],
)  # fmt: skip
def test_a_column_is_under_what_stands_on_it(capsules, beside):
    robot = load_robot("ur5", "none")
    config = RobotConfig.model_validate(robot.content["config"])
    shapes = [CapsuleConfig(link=link, ends_m=ends, radius_m=0.1) for link, ends in capsules]
    assert base_offset(robot.model, config.model_copy(update={"capsules": shapes})) == (
        pytest.approx(beside)
    )
