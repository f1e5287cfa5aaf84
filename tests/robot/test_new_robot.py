import sys

import numpy as np
import pytest
import yaml
from scipy.spatial import ConvexHull

from besman.cli import main as cli
from besman.exceptions import RobotError
from besman.robot.doubts import check_robot
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.robot.new_robot import add_robot

BODY = """<inertial><origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="MASS"/>
<inertia ixx="IXX" iyy="0.01" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.1" rpy="0 0 0"/><geometry>SHAPE</geometry></collision>"""
ARM = """<robot name="mine">
<link name="base"/><link name="upper">BODY</link><link name="fore">BODY</link><link name="hand"/>
<joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
LIMIT</joint>
<joint name="b" type="TYPE"><parent link="upper"/><child link="fore"/><axis xyz="0 1 0"/>
<origin xyz="0 0 0.3" rpy="0 0 0"/><limit lower="0.5" upper="2" effort="20" velocity="3"/></joint>
<joint name="c" type="fixed"><parent link="fore"/><child link="hand"/>
<origin xyz="0 0 0.3" rpy="0 0 0"/></joint></robot>"""
LIMIT = '<limit lower="-1" upper="1" effort="50" velocity="2"/>'


def write_urdf(folder, text=ARM, **changes):
    words = {
        "BODY": BODY,
        "MASS": "1",
        "IXX": "0.01",
        "SHAPE": '<cylinder radius="0.04" length="0.2"/>',
        "LIMIT": LIMIT,
        "TYPE": "revolute",
    } | changes
    for word, value in words.items():
        text = text.replace(word, value)
    path = folder / "my.urdf"
    path.write_text(text)
    return path


def write_box(path):
    corners = np.array(np.meshgrid([0, 0.1], [0, 0.1], [0, 0.3])).reshape(3, 8).T
    faces = ConvexHull(corners).simplices
    lines = ["solid box"]
    for face in faces:
        lines.append("facet normal 0 0 0\nouter loop")
        lines += ["vertex {} {} {}".format(*corners[index]) for index in face]
        lines.append("endloop\nendfacet")
    path.write_text("\n".join([*lines, "endsolid box\n"]))


def run(capsys, *arguments):
    argv, sys.argv = sys.argv, ["besman", *map(str, arguments)]
    try:
        with pytest.raises(SystemExit) as end:
            cli.main()
    finally:
        sys.argv = argv
    return end.value.code, *capsys.readouterr()


def test_an_arm_is_added_and_can_be_loaded(tmp_path):
    path = add_robot(write_urdf(tmp_path), "hand")
    robot = load_robot(path)
    assert (robot.name, robot.joint_names, robot.tool.name) == ("mine", ("a", "b"), "none")
    np.testing.assert_allclose(robot.limits.velocity, [2, 3])
    np.testing.assert_allclose(robot.limits.torque, [50, 20])
    np.testing.assert_allclose(robot.limits.position_min, [-1, 0.5], atol=1e-7)
    np.testing.assert_allclose(robot.home, [0, 1.25], atol=1e-7)
    tip = forward_kinematics(robot.chain, [0.0, np.pi / 2])
    np.testing.assert_allclose(tip[:3, 3], [0.3, 0, 0.3], atol=1e-9)
    assert robot.chain.capsule_radii.tolist() == [0.04, 0.04]
    assert "accelerations of all joints" in yaml.safe_load(path.read_text())["assumed"]


def test_elsewhere_with_meshes_in_the_same_folder(tmp_path):
    (tmp_path / "urdf").mkdir()
    shape = '<mesh filename="package://meshes/no.stl"/>'
    urdf = write_urdf(tmp_path / "urdf", SHAPE=shape)
    with pytest.raises(RobotError, match="collision meshes: Could not load resource") as caught:
        add_robot(urdf, "hand", "own", tmp_path)
    # Which mesh, and where it was looked for.
    assert f'Unable to open file "{tmp_path / "meshes" / "no.stl"}"' in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "assimp.cpp" not in str(caught.value)
    assert not (tmp_path / "robot.yaml").exists()
    (tmp_path / "meshes").mkdir()
    write_box(tmp_path / "meshes" / "no.stl")
    path = add_robot(urdf, "hand", "own", tmp_path)
    assert yaml.safe_load(path.read_text())["urdf"] == "urdf/my.urdf"
    assert len(load_robot(path).chain.capsule_radii) >= 2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"LIMIT": ""}, "joint a: <limit> velocity: got None, expected a number"),
        ({"LIMIT": LIMIT.replace('"2"', '"0"')}, "joint a: <limit> velocity: got 0, expected more"),
        ({"LIMIT": LIMIT.replace('"-1"', '"1"')}, "joint a: expected <limit> with lower below"),
        ({"LIMIT": LIMIT.replace('"50"', '"x"')}, "my.urdf"),
        ({"TYPE": "prismatic"}, "joint b: only hinges can be used, got 'prismatic'"),
    ],
)
def test_an_arm_that_cannot_be_added(tmp_path, changes, message):
    with pytest.raises(RobotError, match=message):
        add_robot(write_urdf(tmp_path, **changes), "hand")
    assert not (tmp_path / "robot.yaml").exists()


def test_tips_and_names_that_cannot_be(tmp_path):
    urdf = write_urdf(tmp_path)
    with pytest.raises(RobotError, match="tip: no link 'hnd'; did you mean 'hand'"):
        add_robot(urdf, "hnd")
    with pytest.raises(RobotError, match="tip: no joint moves the link 'base'"):
        add_robot(urdf, "base")
    with pytest.raises(RobotError, match="there is a robot 'ur5' already"):
        add_robot(urdf, "hand", "ur5")
    with pytest.raises(RobotError, match=r"name: got '../x', expected letters"):
        add_robot(urdf, "hand", "../x")
    with pytest.raises(RobotError, match=r"no\.urdf: no such file"):
        add_robot(tmp_path / "no.urdf", "hand")


def test_nothing_is_overwritten(tmp_path):
    urdf = write_urdf(tmp_path)
    before = add_robot(urdf, "hand").read_bytes()
    with pytest.raises(RobotError, match="nothing is overwritten"):
        add_robot(urdf, "hand")
    assert (tmp_path / "robot.yaml").read_bytes() == before


def test_a_hinge_without_end(tmp_path):
    urdf = write_urdf(tmp_path, TYPE="continuous")
    robot = load_robot(add_robot(urdf, "hand", "turner", tmp_path / "out"))
    assert robot.limits.position_max[1] == pytest.approx(2 * np.pi)


@pytest.mark.parametrize(
    ("changes", "kind", "message"),
    [
        ({"IXX": "0.5"}, "doubtful", "no body has the moments"),
        ({"IXX": "0.5"}, "doubtful", "a radius of gyration of 0.7"),
        ({"MASS": "0"}, "doubtful", "a mass of 0 kg"),
        ({"BODY": BODY.partition("<collision>")[0]}, "doubtful", "no capsules"),
        ({"LIMIT": LIMIT.replace('"2"', '"50"')}, "doubtful", "joint a: a speed of 2865"),
        ({"LIMIT": LIMIT.replace('"50"', '"0.5"')}, "doubtful", "joint a would need"),
        ({}, "doubtful", "no SOURCES.md"),
        ({}, "assumed", "accelerations of all joints"),
    ],
)
def test_what_is_doubtful(tmp_path, changes, kind, message):
    doubts = check_robot(add_robot(write_urdf(tmp_path, **changes), "hand"))
    assert any(doubt.kind == kind and message in doubt.text for doubt in doubts), doubts


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c["joints"][0].update(torque_nm=0), "joint a: torque_nm leaves no room"),
        (lambda c: c["joints"][0].update(position_deg=[5, 5]), "joint a: position_deg leaves no"),
        (lambda c: c.update(urdf="no.urdf"), "urdf: no file"),
        (lambda c: c.update(tip="no"), "tip: no link 'no'"),
    ],
)
def test_what_is_missing(tmp_path, capsys, change, message):
    path = add_robot(write_urdf(tmp_path), "hand")
    content = yaml.safe_load(path.read_text())
    change(content)
    path.write_text(yaml.safe_dump(content))
    assert any(d.kind == "missing" and message in d.text for d in check_robot(path))
    code, printed, _ = run(capsys, "robots", "check", path)
    assert code == 1
    assert message.split("'")[0] in printed


def test_a_mesh_that_is_not_there(tmp_path):
    path = add_robot(write_urdf(tmp_path), "hand")
    write_urdf(tmp_path, SHAPE='<mesh filename="no.stl"/>')
    assert any("no.stl: no such file" in doubt.text for doubt in check_robot(path))


def test_robots_that_are_there_miss_nothing():
    for name in ("ur5", "ur10", "iiwa7", "compi"):
        assert {doubt.kind for doubt in check_robot(name)} == {"assumed"}


def test_the_commands(tmp_path, capsys):
    code, printed, _ = run(capsys, "robots", "add", write_urdf(tmp_path), "--tip", "hand")
    assert code == 0
    assert f"wrote {tmp_path / 'robot.yaml'}" in printed
    assert "assumed   accelerations of all joints" in printed
    assert "mine: base" in run(capsys, "robots", tmp_path / "robot.yaml")[1]
    assert "iiwa7" in run(capsys, "robots")[1]
    assert "ur10: base" in run(capsys, "robots", "ur10")[1]
    code, _, said = run(capsys, "robots", "ur55")
    assert (code, said.count("\n")) == (2, 1)
