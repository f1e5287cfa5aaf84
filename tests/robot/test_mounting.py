"""Arms on walls and ceilings: the upright arm, turned; its weight still points down."""

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio
import pytest
import yaml
from scipy.spatial.transform import Rotation

from besman.robot.branches import joint_box
from besman.robot.collision import distances, place_all
from besman.robot.dynamics import inverse_dynamics
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import find_robot, load_robot
from besman.robot.mujoco_model import arm_spec
from besman.robot.ur_kinematics import read_geometry, solve_branches

POSES = np.random.default_rng(3).uniform(-2, 2, (10, 6))


@pytest.fixture(scope="module", params=[(90, 0, 0), (0, 90, 30), (180, 0, -40), (20, -35, 70)])
def tilted(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("tilted")
    content = yaml.safe_load(find_robot("ur5").read_text())
    names = dict(zip(("roll_deg", "pitch_deg", "yaw_deg"), request.param, strict=True))
    content |= {"name": "tilted"}
    content["mounting"] = {"height_m": 1.5, "pedestal_radius_m": 0.0} | names
    (folder / "tilted.yaml").write_text(yaml.safe_dump(content))
    turn = Rotation.from_euler("xyz", request.param, degrees=True).as_matrix()
    return load_robot(folder / "tilted.yaml", "stick_holder"), turn


def test_it_is_the_upright_arm_turned_about_its_base(tilted):
    robot, turn = tilted
    upright = load_robot("ur5", "stick_holder")
    ours, theirs = (forward_kinematics(one.chain, POSES) for one in (robot, upright))
    way = theirs[:, :3, 3] - [0, 0, upright.base_height]
    np.testing.assert_allclose(ours[:, :3, 3], way @ turn.T + [0, 0, 1.5], atol=1e-9)
    np.testing.assert_allclose(ours[:, :3, :3], turn @ theirs[:, :3, :3], atol=1e-9)
    # It is as near to itself; the floor is elsewhere.
    ignoring = [distances(one.chain, POSES[:, :6])[:, 0] for one in (robot, upright)]
    assert np.all(ignoring[0] >= ignoring[1] - 1e-9)


def test_a_first_link_that_can_fall_is_held_against_the_floor(tilted):
    robot, turn = tilted
    chain = robot.chain
    upright = abs(turn[2, 2]) > 0.9999
    placed = place_all(
        chain.placements, chain.axes, chain.capsule_joints, chain.capsule_ends, POSES
    )
    heights = placed[..., 2].min(axis=2) - chain.capsule_radii
    lowest = heights[:, chain.capsule_joints >= (1 if upright else 0)].min(axis=1)
    np.testing.assert_allclose(distances(chain, POSES)[:, 1], lowest, atol=1e-12)
    # The bare link, close above the floor.
    alone = replace(chain, capsule_joints=np.minimum(chain.capsule_joints, 0))
    found = distances(alone, POSES)[:, 1]
    np.testing.assert_allclose(found, np.inf if upright else heights_of_first(alone), atol=1e-12)


def heights_of_first(chain):
    """The lowest point of what the first joint moves, at every pose."""
    placed = place_all(
        chain.placements, chain.axes, chain.capsule_joints, chain.capsule_ends, POSES
    )
    heights = placed[..., 2].min(axis=2) - chain.capsule_radii
    return heights[:, chain.capsule_joints == 0].min(axis=1)


def test_weight_points_down_in_both_engines(tilted):
    robot, _ = tilted
    model = arm_spec(robot, 0.002)[0].compile()
    data, still = mujoco.MjData(model), np.zeros_like(POSES)
    for pose, torque in zip(POSES, inverse_dynamics(robot, POSES, still, still), strict=True):
        weight = pinocchio.computeGeneralizedGravity(robot.model, robot.model.createData(), pose)
        np.testing.assert_allclose(torque, weight, atol=1e-8)
        data.qpos[:] = pose
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(data.qfrc_inverse, weight, atol=1e-8)


def test_closed_form_reaches_its_poses(tilted):
    robot, _ = tilted
    poses = forward_kinematics(robot.chain, POSES)
    found, valid = solve_branches(read_geometry(robot.chain), poses, *joint_box(robot), robot.home)
    assert valid.any(axis=1).all()
    reached = forward_kinematics(robot.chain, found)
    apart = np.abs(reached - poses[:, None]).max(axis=(2, 3))
    assert apart[valid].max() < 1e-6
