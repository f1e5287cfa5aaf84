import json
import sys
from pathlib import Path

import numpy as np
import pinocchio
import pytest
import yaml

import besman.robot
from besman.config.resources import resource_folder
from besman.config.yaml_file import load_config
from besman.exceptions import ConfigError, RobotError
from besman.robot.capsules import fit_capsules
from besman.robot.config import RobotConfig
from besman.robot.link_shapes import link_meshes
from besman.robot.model import find_robot, list_robots, load_robot
from besman.robot.urdf_file import read_urdf

UR5 = resource_folder("robots") / "ur5" / "robot.yaml"

BOX_ARM = """<robot name="arm">
<link name="base"/>
<link name="upper"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
 iyz="0"/></inertial></link>
<link name="hand"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
 iyz="0"/></inertial></link>
<joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="b" type="TYPE"><parent link="upper"/><child link="hand"/><axis xyz="0 1 0"/>
<origin xyz="0 0 0.3"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


def write_robot(folder, change):
    content = yaml.safe_load(UR5.read_text()) | {"name": "own"}
    change(content)
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def write_arm(folder, urdf):
    (folder / "arm.urdf").write_text(urdf)
    joint = {
        "position_deg": [-50, 50],
        "velocity_deg_s": 90,
        "acceleration_rad_s2": 5,
        "torque_nm": 10,
        "home_deg": 0,
    }
    content = {
        "name": "arm",
        "urdf": "arm.urdf",
        "tip": "hand",
        "joints": [{"name": "a", **joint}, {"name": "b", **joint}],
        "tools": {"none": {}},
        "default_tool": "none",
    }
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def test_the_ur5_has_its_published_limits():
    robot = load_robot("ur5")
    assert robot.n == 6
    np.testing.assert_allclose(robot.limits.velocity, np.pi)
    np.testing.assert_allclose(robot.limits.torque, [150, 150, 150, 28, 28, 28])
    assert robot.joint_names[0] == "shoulder_pan_joint"
    assert "ur5" in list_robots()


def test_arrays_are_read_only_and_the_content_is_plain():
    robot = load_robot("ur5", "gripper")
    for array in (robot.home, robot.limits.velocity, robot.chain.tip, robot.chain.capsule_pairs):
        assert not array.flags.writeable
    assert json.loads(json.dumps(robot.content)) == robot.content
    assert robot.content != load_robot("ur5", "none").content


def test_two_robots_do_not_share_state():
    first, second = load_robot("ur5"), load_robot("ur5", "gripper")
    assert first.tool.name == "none"
    assert second.model.inertias[6].mass == pytest.approx(first.model.inertias[6].mass + 0.925)


def test_the_wrist_inertia_is_overridden():
    robot = load_robot("ur5")
    assert robot.model.inertias[4].inertia.max() < 0.01
    masses = [inertia.mass for inertia in list(robot.model.inertias)[1:]]
    assert sum(masses) == pytest.approx(3.7 + 8.393 + 2.33 + 2 * 1.219 + 0.1879)


def test_the_world_is_the_floor_below_the_base():
    robot = load_robot("ur5")
    data = robot.model.createData()
    pinocchio.framesForwardKinematics(robot.model, data, robot.home)
    base = data.oMf[robot.model.getFrameId("base_link")].translation
    np.testing.assert_allclose(base, [0, 0, robot.base_height])
    # Home points the tool forward, in front of the base.
    tcp = data.oMf[robot.tip_frame]
    np.testing.assert_allclose(tcp.rotation[:, 2], [1, 0, 0], atol=1e-9)
    assert tcp.translation[0] > 0.2


def test_the_stored_capsules_enclose_the_meshes():
    robot = load_robot("ur5", "none")
    config = load_config(UR5, RobotConfig)
    folder = Path(str(pinocchio.__file__)).parents[4] / "share"
    urdf = folder / "example-robot-data/robots" / config.urdf.partition(":")[2]
    chain = robot.chain
    checked = 0
    for link, joint, vertices, triangles in link_meshes(robot.model, read_urdf(urdf, folder), urdf):
        depth = []
        for index, owner in enumerate(chain.capsule_links):
            if owner != link:
                continue
            assert chain.capsule_joints[index] == joint
            start, end = chain.capsule_ends[index]
            along = end - start
            share = np.clip((vertices - start) @ along / max(along @ along, 1e-12), 0, 1)
            distance = np.linalg.norm(vertices - start - share[:, None] * along, axis=1)
            depth.append((distance - chain.capsule_radii[index])[triangles].max(axis=1))
        assert np.min(depth, axis=0).max() <= 0.0, link
        checked += 1
    assert checked == 7


def test_fitted_capsules_enclose_a_bent_mesh():
    rng = np.random.default_rng(0)
    first = rng.uniform(-1, 1, (300, 3)) * [0.5, 0.05, 0.05]
    second = rng.uniform(-1, 1, (300, 3)) * [0.05, 0.05, 0.5] + [0.5, 0, 0.5]
    vertices = np.vstack([first, second])
    triangles = np.vstack([rng.integers(0, 300, (300, 3)), rng.integers(300, 600, (300, 3))])
    capsules = fit_capsules(vertices, triangles)
    assert len(capsules) > 1
    inside = np.zeros(len(triangles), dtype=bool)
    for ends, radius in capsules:
        along = ends[1] - ends[0]
        share = np.clip((vertices - ends[0]) @ along / max(along @ along, 1e-12), 0, 1)
        distance = np.linalg.norm(vertices - ends[0] - share[:, None] * along, axis=1)
        inside |= (distance <= radius + 1e-12)[triangles].all(axis=1)
    assert inside.all()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("velocity_deg_s", 0, "joint elbow_joint: velocity_deg_s: got 0, expected more than 0"),
        ("torque_nm", -1, "joint elbow_joint: torque_nm: got -1, expected more than 0"),
        ("acceleration_rad_s2", 0, "joint elbow_joint: acceleration_rad_s2: got 0"),
        ("position_deg", [10, 10], "elbow_joint: position_deg: got .* the lower limit below"),
        ("home_deg", 200, "elbow_joint: home_deg: got 200, expected it within"),
        ("name", "elbow", "no joint 'elbow' in the URDF; did you mean 'elbow_joint'"),
    ],
)
def test_a_joint_that_cannot_be_used(tmp_path, key, value, message):
    path = write_robot(tmp_path, lambda content: content["joints"][2].update({key: value}))
    with pytest.raises(RobotError, match=message):
        load_robot(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tip": "tool1"}, "tip: no link 'tool1'; did you mean 'tool0'"),
        ({"tip": "forearm_link"}, "tip: link 'forearm_link' does not hang on the last joint"),
        ({"urdf": "no.urdf"}, "urdf: no file"),
        ({"urdf": "somewhere:no.urdf"}, "expected a relative path or 'example-robot-data:PATH'"),
        ({"inertia": {"wrist": {"mass_kg": 1, "com_m": [0, 0, 0], "inertia_kgm2": [1, 1, 1]}}},
         "inertia: no link 'wrist'"),
        ({"capsules": [{"link": "arm", "ends_m": [[0, 0, 0], [0, 0, 1]], "radius_m": 0.1}]},
         "capsules: no link 'arm'"),
    ],
)  # fmt: skip
def test_a_robot_that_cannot_be_used(tmp_path, change, message):
    path = write_robot(tmp_path, lambda content: content.update(change))
    with pytest.raises(RobotError, match=message):
        load_robot(path)


def test_names_that_are_not_there():
    with pytest.raises(RobotError, match=r"no tool 'scop'; did you mean 'scoop'.*stick_holder"):
        load_robot("ur5", "scop")
    with pytest.raises(RobotError, match="no robot 'ur55'; did you mean 'ur5'"):
        load_robot("ur55")
    assert find_robot("ur5") == UR5


def test_pinocchio_that_cannot_be_loaded(monkeypatch):
    # As on a machine without GCC's OpenMP library.
    monkeypatch.setitem(sys.modules, "besman.robot.pinocchio_model", None)
    monkeypatch.delattr(besman.robot, "pinocchio_model", raising=False)
    message = (
        "robot ur5: Pinocchio cannot be loaded: .*pinocchio_model.*; libgomp.so.1, .* libgomp1"
    )
    with pytest.raises(RobotError, match=message):
        load_robot("ur5")


def test_two_robots_with_one_name(tmp_path):
    path = write_robot(tmp_path, lambda content: content.update(name="ur5"))
    with pytest.raises(RobotError, match=r"name: 'ur5' is the robot .*expected another name"):
        load_robot(path)


def test_a_name_that_is_not_the_folders(tmp_path, monkeypatch):
    (tmp_path / "robots" / "arm").mkdir(parents=True)
    write_robot(tmp_path / "robots" / "arm", lambda content: None)
    monkeypatch.setattr("besman.robot.model.resource_folder", lambda kind: tmp_path / kind)
    with pytest.raises(RobotError, match="name: got 'own', expected the folder's, 'arm'"):
        load_robot("arm")


def test_a_misspelt_key_is_named(tmp_path):
    path = write_robot(tmp_path, lambda content: content.update(tipp="tool0"))
    with pytest.raises(ConfigError, match="unknown key 'tipp'; did you mean 'tip'"):
        load_robot(path)


def test_a_quaternion_of_zero(tmp_path):
    def change(content):
        content["tools"]["none"]["rotation_wxyz"] = [0, 0, 0, 0]

    with pytest.raises(ConfigError, match="expected a quaternion"):
        load_robot(write_robot(tmp_path, change))


def test_an_own_urdf(tmp_path):
    robot = load_robot(write_arm(tmp_path, BOX_ARM.replace("TYPE", "revolute")))
    assert robot.n == 2
    assert robot.chain.capsule_pairs.shape == (0, 2)


@pytest.mark.parametrize(
    ("urdf", "message"),
    [
        (BOX_ARM.replace("TYPE", "prismatic"), "joint b: only hinges"),
        (BOX_ARM.replace("TYPE", "fixed"), "joints: no joint 'b'"),
        (
            BOX_ARM.replace("TYPE", "hinge"),
            r"used as URDF: Joint \[b\] has no known type",
        ),
        ("<robot", "not valid XML"),
        ("<robot name='a'></robot>", "cannot be used as URDF"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><robot/>', "entities are not allowed"),
    ],
)
def test_an_own_urdf_that_cannot_be_used(tmp_path, urdf, message):
    with pytest.raises(RobotError, match=message):
        load_robot(write_arm(tmp_path, urdf))
