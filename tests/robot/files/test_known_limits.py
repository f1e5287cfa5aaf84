"""Published limits: found by the arm's name, used where a file gives none."""

import re
from xml.etree import ElementTree

import pytest
import yaml
from pydantic import ValidationError

from besman.robot.description_faults import check_robot
from besman.robot.files.arm_files import check_name, free_name
from besman.robot.files.known_limits import KnownArm, arm_titles, find_known_arm, known_arms
from besman.robot.model import load_robot
from besman.robot.new_robot import add_robot
from besman.robot.workspace import sample_workspace


def test_every_arm_has_figures_of_all_its_joints_and_a_source():
    names = [name for arm in known_arms().values() for name in arm.names]
    assert len(known_arms()) >= 10
    for arm in known_arms().values():
        assert len(arm.source) > 10
        assert 4 <= arm.n <= 7
        for key, values in arm.limits.items():
            top = {"velocity_deg_s": 1000, "torque_nm": 3000, "acceleration_rad_s2": 100}[key]
            assert max(values) <= top
    # Of two arms with one name the number of joints tells which it is.
    twice = {(name, arm.n) for arm in known_arms().values() for name in arm.names}
    assert len(twice) == len(names)


@pytest.mark.parametrize(
    ("titles", "n", "arm"),
    [
        (["ur3e"], 6, "Universal Robots UR3e"),
        (["my UR3e with gripper"], 6, "Universal Robots UR3e"),
        (["robot", "ur_3e"], 6, "Universal Robots UR3e"),
        (["ur3e"], 7, None),
        (["ur3ex", "aur3e"], 6, None),
        ([""], 6, None),
    ],
)
def test_an_arm_is_found_by_whole_words_and_its_joints(titles, n, arm):
    found = find_known_arm(titles, n)
    assert (None if found is None else found.arm) == arm


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"torque_nm": (1.0,)}, "all of the same number of joints"),
        ({"velocity_deg_s": None}, "expected figures"),
        ({"names": ("UR 5",)}, "expected lower case letters and digits"),
        ({"velocity_deg_s": (0.0, 1.0)}, "greater than 0"),
        ({"reach_m": 0.8}, "expected reach_m and reach_source, or neither"),
    ],
)
def test_what_is_no_entry(changes, message):
    entry = {"arm": "A", "names": ("a1",), "velocity_deg_s": (1.0, 2.0), "source": "a sheet"}
    assert KnownArm(**entry).n == 2
    with pytest.raises(ValidationError, match=message):
        KnownArm(**(entry | changes))


def write_ur3e(folder, size=1.0):
    """An arm of the name, of six links."""
    links = "".join(f'<link name="l{k}"/>' for k in range(7))
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="0 {0.02 * size} {0.1 * size}"/><axis xyz="0 {k % 2} {1 - k % 2}"/>'
        f'<limit lower="-2" upper="2" velocity="{1 if k == 1 else 0}" effort="0"/></joint>'
        for k in range(6)
    )
    urdf = folder / "arm.urdf"
    urdf.write_text(f'<robot name="ur3e">{links}{joints}</robot>')
    return urdf


def test_a_file_that_gives_no_limits_has_those_of_its_maker(tmp_path):
    path = add_robot(write_ur3e(tmp_path), torque="5")
    content = yaml.safe_load(path.read_text())
    known = known_arms()["ur3e"]
    speeds = [joint["velocity_deg_s"] for joint in content["joints"]]
    assert speeds[0] == known.velocity_deg_s[0]
    assert speeds[1] == pytest.approx(57.29578)
    assert [joint["origin"]["velocity_deg_s"] for joint in content["joints"]][:2] == [
        "Universal Robots UR3e",
        "the file",
    ]
    assert {joint["torque_nm"] for joint in content["joints"]} == {5.0}
    assert {joint["origin"]["torque_nm"] for joint in content["joints"]} == {"the command"}
    said = [one for one in content["assumed"] if "Universal Robots UR3e's, from" in one]
    assert len(said) == 1
    assert re.search(r"UR3e", said[0])
    assert load_robot(path).n == 6
    assert not [one for one in check_robot(path) if one.text.startswith("reach:")]


def test_a_file_of_another_size_than_its_arm_is_said(tmp_path):
    path = add_robot(write_ur3e(tmp_path, 4.0), torque="500", name="big")
    said = [one.text for one in check_robot(path) if one.text.startswith("reach:")]
    reach = sample_workspace(load_robot(path)).reach_m
    assert said == [
        f"reach: {reach:.2f} m from the second joint to the flange, {reach / 0.5:.2g} times the "
        "0.5 m that are published of Universal Robots UR3e; look at the unit and the scale of "
        "origins and meshes; Universal Robots, technical specifications of the UR3e (reach 500 mm)"
    ]


def test_a_name_that_a_robot_has_is_made_another(tmp_path):
    assert free_name(" a b/c ") == "a_b_c"
    assert free_name("ur5") == "my_ur5"
    assert free_name("try") == "my_try"
    assert check_name(free_name("ur5"), tmp_path) == "my_ur5"


def test_a_scene_is_known_by_the_arm_that_it_includes():
    tree = ElementTree.fromstring('<robot name="scene"><joint name="right_j0"/></robot>')
    titles = arm_titles(tree, ["scene", "so-arm100"])
    assert titles == ["scene", "scene", "so-arm100", "right_j0"]
    assert find_known_arm(titles, 5).arm.startswith("SO-100")
