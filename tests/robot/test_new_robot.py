import sys

import numpy as np
import pytest
import yaml
from scipy.spatial import ConvexHull

from besman.cli import main as cli
from besman.exceptions import RobotError
from besman.robot.collision import distances
from besman.robot.description_faults import check_robot
from besman.robot.dynamics import inverse_dynamics
from besman.robot.kinematics import forward_kinematics, manipulability
from besman.robot.model import find_robot, find_urdf, load_robot
from besman.robot.mujoco_model import arm_spec
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
    assert path.name == "mine.yaml"
    assert np.all((robot.home >= [-1, 0.5]) & (robot.home <= [1, 2]))
    tip = forward_kinematics(robot.chain, [0.0, np.pi / 2])
    np.testing.assert_allclose(tip[:3, 3], [0.3, 0, 0.3 + robot.base_height], atol=1e-9)
    assert robot.chain.capsule_radii.tolist() == [0.04, 0.04]
    assert "accelerations of all joints" in yaml.safe_load(path.read_text())["assumed"]


def test_a_name_longer_than_a_file_may_have_is_cut(tmp_path):
    path = add_robot(
        write_urdf(tmp_path, ARM.replace('name="mine"', f'name="{"x" * 300}"')), "hand"
    )
    assert path.stem == load_robot(path).name == "x" * 100


def test_elsewhere_with_meshes_in_the_same_folder(tmp_path):
    (tmp_path / "urdf").mkdir()
    shape = '<mesh filename="package://meshes/no.stl"/>'
    urdf = write_urdf(tmp_path / "urdf", SHAPE=shape)
    # The arm comes in without the mesh, and says which it is and where it was looked for.
    path = add_robot(urdf, "hand", "own", tmp_path)
    assumed = yaml.safe_load(path.read_text())["assumed"]
    where = f"mesh {tmp_path / 'meshes' / 'no.stl'}: no such file: no folder called meshes above"
    assert any(one.startswith(where) and "give --package meshes=FOLDER" in one for one in assumed)
    assert "capsules along upper, fore: no shape is given" in assumed
    path.unlink()
    (tmp_path / "meshes").mkdir()
    write_box(tmp_path / "meshes" / "no.stl")
    path = add_robot(urdf, "hand", "own", tmp_path)
    assert yaml.safe_load(path.read_text())["urdf"] == "urdf/my.urdf"
    assert len(load_robot(path).chain.capsule_radii) >= 2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"LIMIT": LIMIT.replace('"2"', '"-2"')}, "joint a: <limit> velocity: got -2, expected 0"),
        ({"LIMIT": LIMIT.replace('"2"', '"fast"')}, "velocity: got 'fast', expected a number"),
        ({"LIMIT": LIMIT.replace('"-1"', '"1"')}, "joint a: expected <limit> with lower below"),
        ({"LIMIT": LIMIT.replace('"50"', '"x"')}, "my.urdf"),
        ({"TYPE": "planar"}, "joint b: only hinges and sliding joints can be used, got 'planar'"),
    ],
)
def test_an_arm_that_cannot_be_added(tmp_path, changes, message):
    with pytest.raises(RobotError, match=message):
        add_robot(write_urdf(tmp_path, **changes), "hand")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["my.urdf"]


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
    assert (tmp_path / "mine.yaml").read_bytes() == before
    # Another arm of the same folder has its own file.
    assert add_robot(urdf, "hand", "other") == tmp_path / "other.yaml"


def test_a_hinge_without_end(tmp_path):
    urdf = write_urdf(tmp_path, TYPE="continuous")
    robot = load_robot(add_robot(urdf, "hand", "turner", tmp_path / "out"))
    assert robot.limits.position_max[1] == pytest.approx(2 * np.pi)


@pytest.mark.parametrize(
    ("changes", "kind", "message"),
    [
        ({"IXX": "0.5"}, "doubtful", "no body has the moments"),
        ({"IXX": "0.5"}, "doubtful", "a radius of gyration of 0.7"),
        ({"MASS": "0"}, "assumed", "mass of what joint a moves: 1."),
        ({"BODY": BODY.partition("<collision>")[0]}, "assumed", "capsules along upper, fore"),
        ({"LIMIT": ""}, "assumed", "speed of a: 120 degrees/s, not given"),
        ({"LIMIT": ""}, "assumed", "position of a: -180 to 180 degrees, not given"),
        ({"LIMIT": LIMIT.replace('"50"', '"0"')}, "assumed", "torque of a: "),
        ({"LIMIT": LIMIT.replace('"2"', '"50"')}, "doubtful", "joint a: a speed of 2865"),
        ({"LIMIT": LIMIT.replace('"50"', '"0.01"')}, "doubtful", "joint a would need"),
        ({}, "assumed", "accelerations of all joints"),
    ],
)
def test_what_is_doubtful(tmp_path, changes, kind, message):
    doubts = check_robot(add_robot(write_urdf(tmp_path, **changes), "hand"))
    assert any(doubt.kind == kind and message in doubt.text for doubt in doubts), doubts


def test_an_arm_whose_joints_are_all_slow_is_doubted(tmp_path):
    path = add_robot(write_urdf(tmp_path), "hand")
    content = yaml.safe_load(path.read_text())
    for joint in content["joints"]:
        joint["velocity_deg_s"] = 17
    path.write_text(yaml.safe_dump(content))
    assert any("no joint is faster than 17 deg" in doubt.text for doubt in check_robot(path))


def test_an_inertia_that_no_body_has_is_said_and_can_be_simulated(tmp_path):
    path = add_robot(write_urdf(tmp_path, IXX="0.5"), "hand")
    assumed = yaml.safe_load(path.read_text())["assumed"]
    assert any("inertia of what joint a moves: no body has the file's" in one for one in assumed)
    spec, _ = arm_spec(load_robot(path), 0.001)
    assert spec.compile().njnt == 2


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


def test_numbers_without_an_origin_are_doubtful(tmp_path):
    path = add_robot(write_urdf(tmp_path), "hand")
    content = yaml.safe_load(path.read_text())
    assert {word for joint in content["joints"] for word in joint["origin"].values()} == {
        "the file",
        "assumed",
    }
    assert not any("SOURCES.md" in doubt.text for doubt in check_robot(path))
    del content["joints"][0]["origin"]
    path.write_text(yaml.safe_dump(content))
    assert any("no SOURCES.md beside it" in doubt.text for doubt in check_robot(path))


def test_robots_that_are_there_miss_nothing():
    for name in ("ur5", "ur10", "iiwa7", "compi"):
        assert {doubt.kind for doubt in check_robot(name)} == {"assumed"}


def test_the_commands(tmp_path, capsys):
    code, printed, _ = run(capsys, "robots", "add", write_urdf(tmp_path), "--tip", "hand")
    assert code == 0
    assert f"wrote {tmp_path / 'mine.yaml'}" in printed
    assert "assumed   accelerations of all joints" in printed
    assert "mine: base" in run(capsys, "robots", tmp_path / "mine.yaml")[1]
    assert "iiwa7" in run(capsys, "robots")[1]
    assert "ur10: base" in run(capsys, "robots", "ur10")[1]
    code, _, said = run(capsys, "robots", "ur55")
    assert (code, said.count("\n")) == (2, 1)


LINK = '<link name="{}"/>'
TURN = """<joint name="{0}" type="{3}"><parent link="{1}"/><child link="{2}"/>
<origin xyz="0 0 0.2"/><axis xyz="{4}"/><limit lower="-2" upper="2" effort="9" velocity="2"/>{5}
</joint>"""


def write_links(folder, *joints, name="long"):
    """Joints: (name, parent, child, type, axis, more)."""
    links = dict.fromkeys(one for joint in joints for one in joint[1:3])
    text = "".join(LINK.format(link) for link in links)
    text += "".join(TURN.format(*joint, *("revolute", "0 1 0", "")[len(joint) - 3 :])
                    for joint in joints)  # fmt: skip
    path = folder / f"{name}.urdf"
    path.write_text(f'<robot name="{name}">{text}</robot>')
    return path


def content_of(path):
    return yaml.safe_load(path.read_text())


def test_the_tip_is_found_before_the_gripper_and_a_conventional_name_comes_first(tmp_path):
    arm = [(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(5)]
    fingers = [("left_finger", "l5", "f1", "prismatic"), ("right_finger", "l5", "f2", "prismatic")]
    for more, tip in (
        ([], "l5"),
        ([("m", "l5", "mount", "fixed"), ("t", "mount", "x_tool0", "fixed"),
          ("s", "mount", "camera", "fixed"), ("e", "x_tool0", "end", "fixed")], "x_tool0"),
        (fingers, "l5"),
    ):  # fmt: skip
        path = add_robot(write_links(tmp_path, *arm, *more), name=f"a{tip}{len(more)}")
        assert content_of(path)["tip"] == tip
        assert f"tip: {tip}, the end of the longest chain" in content_of(path)["assumed"]
        assert len(content_of(path)["joints"]) == 5


def test_more_than_one_arm_is_named(tmp_path):
    two = [
        (f"{side}{i}", f"{side}l{i}" if i else "base", f"{side}l{i + 1}")
        for side in "LR"
        for i in range(5)
    ]
    with pytest.raises(RobotError, match=r"more than one chain.*--tip Ll5 \(5 hinges\), --tip Rl5"):
        add_robot(write_links(tmp_path, *two))
    assert content_of(add_robot(write_links(tmp_path, *two), "Rl5"))["joints"][0]["name"] == "R0"
    with pytest.raises(RobotError, match="no hinge moves any link; expected an arm"):
        add_robot(write_links(tmp_path, ("f", "a", "b", "fixed"), name="stiff"))


def test_a_joint_that_follows_another_one_is_refused_within_the_arm(tmp_path):
    mimic = '<mimic joint="j0" multiplier="-1"/>'
    arm = [("j0", "l0", "l1"), ("j1", "l1", "l2"), ("j2", "l2", "l3", "revolute", "0 1 0", mimic),
           ("j3", "l3", "l4")]  # fmt: skip
    with pytest.raises(RobotError, match=r"joint j2: <mimic>: follows joint 'j0'; coupled joints"):
        add_robot(write_links(tmp_path, *arm), "l4")
    path = add_robot(write_links(tmp_path, *arm))
    assert content_of(path)["tip"] == "l2"
    # A robot.yaml that was written before, or by hand.
    content = content_of(path)
    content["joints"] += [content["joints"][0] | {"name": name} for name in ("j2", "j3")]
    content["tip"] = "l4"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(RobotError, match="joint j2: <mimic>: follows joint 'j0'"):
        load_robot(path)


def test_a_sliding_joint_below_the_arm_is_held_where_it_can_be(tmp_path):
    arm = [(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(3)]
    urdf = write_links(tmp_path, ("lift", "floor", "l0", "prismatic", "0 0 1"), *arm)
    urdf.write_text(urdf.read_text().replace('lower="-2"', 'lower="0.3"', 1))
    path = add_robot(urdf)
    assert content_of(path)["held"] == {"lift": 0.3}
    assert "joint lift is held at 0.3" in content_of(path)["assumed"]
    robot = load_robot(path)
    assert robot.chain.placements[0][2, 3] == pytest.approx(robot.base_height + 0.2 + 0.3 + 0.2)


@pytest.mark.parametrize("change", [lambda c: c.update(held={"lft": 0.1})])
def test_a_held_joint_that_is_not_there(tmp_path, change):
    urdf = write_links(tmp_path, ("lift", "floor", "l0", "prismatic"), ("a", "l0", "l1"))
    path = add_robot(urdf)
    content = content_of(path)
    change(content)
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(RobotError, match="held: no joint 'lft' in the URDF; did you mean 'lift'"):
        load_robot(path)


def test_a_joint_and_a_link_of_one_name(tmp_path):
    names = [("l1", "l0", "l1"), ("l2", "l1", "l2"), ("grip", "l2", "grip", "fixed")]
    same = load_robot(add_robot(write_links(tmp_path, *names), "grip", "same"))
    apart = [(f"j{joint[0]}", *joint[1:]) for joint in names]
    other = load_robot(add_robot(write_links(tmp_path, *apart, name="apart"), "grip"))
    assert same.joint_names == ("l1", "l2")
    poses = np.random.default_rng(0).uniform(-2, 2, (20, 2))
    np.testing.assert_array_equal(
        forward_kinematics(same.chain, poses), forward_kinematics(other.chain, poses)
    )


def test_limits_that_are_not_given_can_be(tmp_path):
    urdf = write_urdf(tmp_path, LIMIT='<limit lower="-1" upper="1" effort="0" velocity="0"/>')
    joints = content_of(add_robot(urdf, velocity="90", torque="7,8"))["joints"]
    assert [joint["velocity_deg_s"] for joint in joints] == pytest.approx([90, np.degrees(3)])
    assert [joint["torque_nm"] for joint in joints] == [7, 20]
    for wrong in ("0", "1,2,3", "x", "-1", "nan"):
        with pytest.raises(RobotError, match=r"--torque: got .*one for each of a, b"):
            add_robot(urdf, name="again", torque=wrong)


def test_an_assumed_torque_holds_the_arm_everywhere(tmp_path):
    urdf = write_urdf(tmp_path, LIMIT='<limit lower="-1" upper="1" effort="0" velocity="2"/>')
    robot = load_robot(add_robot(urdf))
    poses = np.random.default_rng(1).uniform(robot.limits.position_min, robot.limits.position_max,
                                             (300, 2))  # fmt: skip
    still = np.zeros_like(poses)
    weight = np.abs(inverse_dynamics(robot, poses, still, still))[:, 0].max()
    assert robot.limits.torque[0] > 1.2 * weight


def test_home_is_clear_and_not_singular(tmp_path, all_poses):
    ur5 = content_of(find_robot("ur5"))
    urdf, _ = find_urdf(ur5["urdf"], find_robot("ur5"))
    robot = load_robot(add_robot(urdf, name="mine5", folder=tmp_path))
    assert distances(robot.chain, robot.home).min() > 0
    assert manipulability(robot.chain, robot.home) > 0.02
    tcp = forward_kinematics(robot.chain, robot.home)
    assert tcp[0, 3] > 0.2
    assert not any("home" in doubt.text and doubt.kind == "doubtful"
                   for doubt in check_robot(tmp_path / "mine5.yaml"))  # fmt: skip
    np.testing.assert_array_equal(robot.home, load_robot(tmp_path / "mine5.yaml").home)


def test_folders_made_for_an_arm_that_cannot_be_used_are_taken_away(tmp_path, monkeypatch):
    urdf = write_urdf(tmp_path)
    (tmp_path / "there").mkdir()

    def refuse(path):
        assert path.is_file()
        raise RobotError("no such arm")

    monkeypatch.setattr("besman.robot.new_robot.load_robot", refuse)
    for folder in ("there", "there/new", "new/deep"):
        with pytest.raises(RobotError, match="no such arm"):
            add_robot(urdf, folder=tmp_path / folder)
    assert sorted(tmp_path.rglob("*")) == [urdf, tmp_path / "there"]
