from xml.etree import ElementTree

import pytest
from places import TESTS, TOP

from besman.foreign.urdf_text import RANGES, UrdfTextError, joint_ends, link_names, parse_urdf

ARM = (TESTS / "fuzz" / "arm.urdf").read_text()


def test_what_is_in_order_is_parsed_as_another_parser_does():
    tree, other = parse_urdf(ARM), ElementTree.fromstring(ARM)
    assert ElementTree.tostring(tree) == ElementTree.tostring(other)
    assert link_names(tree) == ["base", "upper", "fore", "hand"]
    assert [joint_ends(one) for one in tree.findall("joint")] == [
        ("base", "upper"),
        ("upper", "fore"),
        ("fore", "hand"),
    ]


@pytest.mark.parametrize("path", sorted(TOP.glob("robots/*/*.urdf")), ids=lambda path: path.stem)
def test_every_arm_that_comes_with_besman_passes(path):
    assert parse_urdf(path.read_text()).tag == "robot"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<robot", "<!DOCTYPE x [<!ENTITY a 'b'>]><robot", "document types and entities are not"),
        ("<robot", "<!doctype x><robot", "document types and entities are not"),
        ("</robot>", "", "not valid XML"),
        ('name="a"', 'name="a\x00"', "not valid XML"),
        ("<robot", "<model", "not valid XML|cannot be used as URDF"),
        ('<link name="base"/>', "<x>" * 70 + "</x>" * 70, "more than 64 levels deep"),
        ('name="hand"', 'name="fore"', "link 'fore': the name is there twice"),
        ('name="b"', 'name="a"', "joint 'a': the name is there twice"),
        ('joint name="a"', 'joint name="=1+1"', "joint '=1.1': the name begins with '='"),
        ('joint name="a"', 'joint name="@x"', "the name begins with '@'"),
        ('joint name="a"', 'joint name="a&#10;b"', r"has the control character U\+000A"),
        ('joint name="a"', 'joint name=""', "the name is empty"),
        ('mass value="2"', 'mass value="-1"', "link upper: <mass> value: got '-1', expected 0 to"),
        ('mass value="2"', 'mass value="nan"', "<mass> value: got 'nan', expected a number"),
        ('mass value="2"', 'mass value="1_0"', "<mass> value: got '1_0', expected a number"),
        ('mass value="2"', 'mass value="1e9"', "<mass> value: got '1e9', expected 0 to 10000"),
        ('radius="0.04"', 'radius="-0.1"', "<cylinder> radius: got '-0.1', expected 0 to 10"),
        ('radius="0.05"', 'radius="-1"', "<sphere> radius: got '-1', expected 0 to 10"),
        ('radius="0.05"', 'radius="1e9"', "<sphere> radius: got '1e9', expected"),
        ('xyz="0 1 0"', 'xyz="0 0 0"', "joint a: <axis> xyz: got '0 0 0', expected a direction"),
        ('xyz="0 0 0.3"', 'xyz="0 0"', "joint b: <origin> xyz: got '0 0', expected 3 numbers"),
        ('xyz="0 0 0.3"', 'xyz="0 0 1e6"', "<origin> xyz: got '0 0 1e6', expected -100 to 100"),
        ('ixx="0.01"', 'ixx="1e300"', "<inertia> ixx: got '1e300', expected"),
        ('<child link="fore"/>', '<child link="upper"/>', "loop: link 'upper' hangs on"),
        ('<parent link="base"/>', '<parent link="fore"/>', "loop|hangs on itself"),
        ('<child link="hand"/>', '<child link="foot"/>', "no link 'foot' in the URDF"),
        ('<link name="hand"/>', '<link name="hand"/><link name="else"/>', "got base, else"),
    ],
)
def test_what_no_arm_is_made_of_is_refused(old, new, message):
    assert old in ARM
    with pytest.raises(UrdfTextError, match=message):
        parse_urdf(ARM.replace(old, new, 1))


def test_a_fixed_joint_needs_no_axis():
    parse_urdf(
        ARM.replace(
            '<joint name="c" type="fixed">', '<joint name="c" type="fixed"><axis xyz="0 0 0"/>'
        )
    )


def test_what_is_far_too_long_is_not_parsed():
    with pytest.raises(UrdfTextError, match="at most 20 MB"):
        parse_urdf("<robot>" + " " * 20_000_000)


@pytest.mark.parametrize("one", RANGES, ids=lambda one: f"{one.element} {one.attribute}")
def test_a_number_beyond_each_range_is_refused(one):
    for value in (one.high, 2 * one.high, 2 * one.low - 1):
        words = " ".join([f"{value:g}"] * one.count)
        element = f'<{one.element} {one.attribute}="{words}"/>'
        text = ARM.replace("<inertial>", f"<inertial>{element}", 1)
        if value == one.high:
            parse_urdf(text)
        else:
            with pytest.raises(UrdfTextError, match=f"<{one.element}> {one.attribute}: got"):
                parse_urdf(text)
