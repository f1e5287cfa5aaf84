"""The Pinocchio model of an arm against its robot.yaml, and what is no arm."""

from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest

from besman.config.yaml_file import load_config
from besman.exceptions import RobotError
from besman.robot.config import RobotConfig
from besman.robot.model import find_robot, find_urdf, load_robot
from besman.robot.pinocchio_model import build_chain, build_model
from besman.robot.urdf_file import read_urdf


@pytest.fixture(scope="module")
def parts():
    robot, path = load_robot("ur5", "stick_holder"), find_robot("ur5")
    config = load_config(path, RobotConfig)
    urdf, folder = find_urdf(config.urdf, path)
    return robot, config, read_urdf(urdf, folder), urdf, path


def build(parts, config=None, tree=None):
    robot, own, own_tree, urdf, path = parts
    return build_model(
        config or own, robot.tool, robot.limits, own_tree if tree is None else tree, urdf, path
    )


def test_limits_masses_and_the_tool_are_those_of_the_config(parts):
    robot, config = parts[:2]
    model, tip = build(parts)
    assert list(model.names)[1:] == [joint.name for joint in config.joints]
    np.testing.assert_array_equal(model.upperVelocityLimit, robot.limits.velocity)
    np.testing.assert_array_equal(model.lowerPositionLimit, robot.limits.position_min)
    # The config has the inertia of every link that moves.
    given = sum(inertia.mass_kg for inertia in config.inertia.values())
    carried = sum(inertia.mass for inertia in list(model.inertias)[1:])
    assert carried == pytest.approx(given + robot.tool.mass)
    assert model.frames[tip].name == "tcp"


def test_the_chain_is_the_model_as_arrays(parts):
    robot, config, tree, urdf, path = parts
    model, tip = build(parts)
    chain = build_chain(model, tip, config, robot.tool, tree, urdf, path)
    data, angles = model.createData(), np.linspace(-1, 1, robot.n)
    pinocchio.framesForwardKinematics(model, data, angles)
    pose = np.eye(4)
    for placement, axis, angle in zip(chain.placements, chain.axes, angles, strict=True):
        turn = np.eye(4)
        turn[:3, :3] = pinocchio.exp3(axis * angle)
        pose = pose @ placement @ turn
    np.testing.assert_allclose(pose @ chain.tip, data.oMf[tip].homogeneous, atol=1e-12)
    assert chain.capsule_links[-1] == "tool"
    near = np.abs(np.diff(chain.capsule_joints[chain.capsule_pairs], axis=1))
    assert near.min() > 1
    with pytest.raises(ValueError, match="read-only"):
        chain.tip[0, 0] = 2.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tip": "tol0"}, r"tip: no link 'tol0'; did you mean 'tool0'"),
        ({"joints": lambda joints: joints[::-1]}, "expected one chain from base to tip"),
        ({"tip": "forearm_link"}, "link 'forearm_link' does not hang on the last joint"),
    ],
)
def test_a_config_that_does_not_fit_the_urdf_is_refused(parts, change, message):
    config = parts[1]
    update = {k: v(getattr(config, k)) if callable(v) else v for k, v in change.items()}
    with pytest.raises(RobotError, match=message):
        build(parts, config.model_copy(update=update))


def test_text_that_is_no_urdf_is_refused(parts):
    with pytest.raises(RobotError, match="cannot be used as URDF"):
        build(
            parts,
            parts[1].model_copy(update={"inertia": {}}),
            ElementTree.fromstring("<robot name='a'><link name='b'/><link name='c'/></robot>"),
        )
