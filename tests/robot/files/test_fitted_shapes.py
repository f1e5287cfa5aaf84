"""Capsules and masses that are fitted when an arm is brought in."""

from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest

from besman.config.yaml_file import load_config
from besman.robot.config import RobotConfig
from besman.robot.files.arm_chain import find_chain, find_tip, held_joints
from besman.robot.files.assumed_masses import assume_masses, lighten_masses
from besman.robot.files.fitted_shapes import fit_shapes, use_visual_shapes
from besman.robot.files.second_reader import refuse_faults
from besman.robot.model import find_robot, load_robot, read_robot_urdf


def test_links_without_collision_shapes_get_their_visual_ones():
    tree = ElementTree.fromstring(
        "<robot><link name='a'><visual><origin xyz='1 2 3'/><geometry><sphere radius='1'/>"
        "</geometry><material name='m'/></visual></link><link name='b'><visual/><collision/></link>"
        "<link name='c'/></robot>"
    )
    assert use_visual_shapes(tree) == ["a"]
    (shape,) = tree.findall("link/collision/origin")
    assert shape.get("xyz") == "1 2 3"
    assert tree.find("link/collision/material") is None


@pytest.fixture(scope="module")
def ur5():
    path = find_robot("ur5")
    config = load_config(path, RobotConfig)
    tree, urdf = read_robot_urdf(config, path)
    return load_robot("ur5", "none"), config, tree, urdf, path


def capsule_size(ends, radius):
    return radius**2 * (np.linalg.norm(np.subtract(*ends)) + 4 / 3 * radius)


def test_fitted_capsules_are_those_of_the_robot_and_a_mesh_that_is_none_is_left_out(ur5, tmp_path):
    robot, config, tree, urdf, path = ur5
    bare = config.model_copy(update={"capsules": ()})
    shares = []
    found, notes = fit_shapes(robot.model, bare, tree, urdf, path, shares.append)
    assert notes == []
    assert shares == sorted(shares)
    assert shares[-1] == 1
    volume = {
        "new": sum(capsule_size(one["ends_m"], one["radius_m"]) for one in found),
        "old": sum(capsule_size(one.ends_m, one.radius_m) for one in config.capsules),
    }
    # The tip's frame has a box, which the robot leaves out.
    assert volume["new"] == pytest.approx(volume["old"], rel=0.1)
    broken = tmp_path / "broken.stl"
    broken.write_text("no mesh")
    for mesh in tree.iterfind("link[@name='forearm_link']/collision/geometry/mesh"):
        mesh.set("filename", str(broken))
    (wide,) = tree.iterfind("link[@name='upper_arm_link']/collision/geometry/mesh")
    wide.set("scale", "1000 1000 1000")
    found, notes = fit_shapes(robot.model, bare, tree, urdf, path, shares.append)
    assert set(notes) == {
        f"mesh {broken} cannot be read: the link has no shape of it",
        f"mesh {wide.get('filename')} is wider than 20 m, the link has no shape of it; expected "
        'metres, or scale="0.001 0.001 0.001" for millimetres',
        "capsules along upper_arm_link, forearm_link: no shape is given",
    }
    assert any(one["link"] == "forearm_link" for one in found)


def test_an_assumed_mass_is_that_of_the_capsules(ur5):
    robot, config, *_ = ur5
    model = robot.model.copy()
    for joint in range(1, model.njoints):
        model.inertias[joint] = pinocchio.Inertia.Zero()
    inertia, notes = assume_masses(model, config)
    assert len(notes) == len(inertia) == robot.n
    total = sum(one["mass_kg"] for one in inertia.values())
    # A UR5 weighs 18.4 kg, 4 of them in its base.
    assert 8 < total < 25
    for one in inertia.values():
        first, second, third = sorted(one["inertia_kgm2"])
        assert first > 0
        assert third <= (first + second) * 1.02
    assert assume_masses(robot.model, config) == ({}, [])


def test_the_chain_of_an_arm_that_is_there(ur5):
    _, config, tree, urdf, _ = ur5
    assert find_tip(tree, urdf) == config.tip
    names = [one.get("name") for one in find_chain(tree, config.tip, urdf)]
    assert names == [joint.name for joint in config.joints]
    assert held_joints(tree, config.tip, urdf) == []
    refuse_faults(tree, urdf)


def test_assumed_masses_are_none_that_given_torques_could_not_move(ur5):
    robot, config, *_ = ur5
    model = robot.model.copy()
    for joint in range(1, model.njoints):
        model.inertias[joint] = pinocchio.Inertia.Zero()
    inertia, _ = assume_masses(model, config)
    for link, one in inertia.items():
        frame = model.frames[model.getFrameId(link, pinocchio.FrameType.BODY)]
        body = pinocchio.Inertia(
            one["mass_kg"], np.array(one["com_m"]), np.diag(one["inertia_kgm2"])
        )
        model.inertias[frame.parentJoint] = body.se3Action(frame.placement)
    asked = ([10.0] * robot.n, "tool0", 0.85)
    strong = [{"torque_nm": 1e4} for _ in range(robot.n)]
    before = {link: dict(one) for link, one in inertia.items()}
    assert lighten_masses(inertia, strong, model, *asked) == []
    assert lighten_masses({}, strong, model, *asked) == []
    assert inertia == before
    weak = [{"torque_nm": torque} for torque in (None, 30.0, None, None, None, None)]
    (note,) = lighten_masses(inertia, weak, model, *asked)
    share = inertia["forearm_link"]["mass_kg"] / before["forearm_link"]["mass_kg"]
    assert f"by {share:.0%}" in note
    # Torques grow as masses do: what is asked for now is two thirds of what is given.
    heavy = [{"torque_nm": 30.0 / share * 1.001 if one["torque_nm"] else None} for one in weak]
    assert lighten_masses(inertia, heavy, model, *asked) == []
    assert 0.1 < share < 0.9
