import re

import pytest

from besman.foreign.urdf_text import UrdfTextError, joint_ends, link_names, parse_urdf, ranges

ARM = """<robot name="a"><link name="base"/>
<link name="hand"><inertial><mass value="2"/></inertial>
<collision><geometry><cylinder radius="0.1" length="1"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/></joint>
</robot>"""


def test_an_arm_is_read():
    tree = parse_urdf(ARM)
    assert link_names(tree) == ["base", "hand"]
    assert joint_ends(tree.find("joint")) == ("base", "hand")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</robot>", "", "not valid XML"),
        ("<robot", '<!DOCTYPE a [<!ENTITY b "c">]><robot', "document types and entities"),
        (ARM, "<robot name='a'/>", "expected <robot> with links"),
        (ARM, "<robot>" + "<a>" * 70 + "</a>" * 70 + "</robot>", "more than 64 levels deep"),
        ('name="base"', 'name="ba\u202ese"', "has the control character U+202E"),
        ('name="hand"', 'name="base"', "link 'base': the name is there twice"),
        ('child link="hand"', 'child link="arm"', "joint j: no link 'arm' in the URDF"),
        ('child link="hand"', 'child link="base"', "loop: link 'base' hangs on itself"),
        ('value="2"', 'value="-1"', "link hand: <mass> value: got '-1', expected 0 to 10000"),
        ('radius="0.1"', 'radius="0"', "<cylinder> radius: got '0', expected more than 0 to 10"),
        ('length="1"', 'length="1_0"', "<cylinder> length: got '1_0', expected a number"),
        ('xyz="0 0 1"', 'xyz="0 1"', "joint j: <axis> xyz: got '0 1', expected 3 numbers"),
        ('xyz="0 0 1"', 'xyz="0 0 0"', "<axis> xyz: got '0 0 0', expected a direction"),
        ('<link name="base"/>', '<link name="base"/><link name="c"/>', "got base, c"),
    ],
)
def test_what_is_no_arm_says_why(old, new, message):
    assert old in ARM
    with pytest.raises(UrdfTextError, match=re.escape(message)):
        parse_urdf(ARM.replace(old, new))


@pytest.mark.parametrize(("tag", "key", "low", "high"), ranges())
def test_a_number_beyond_each_range_is_refused(tag, key, low, high):
    for value in (low, high, 2 * high):
        count = 3 if key in ("xyz", "rpy", "size", "scale") else 1
        words = " ".join([f"{value:g}"] * count)
        element = f'<{tag} {key}="{words}"/>'
        text = ARM.replace("<inertial>", f"<inertial>{element}", 1)
        if value == high:
            parse_urdf(text)
        elif value > high:
            with pytest.raises(UrdfTextError, match=f"<{tag}> {key}: got"):
                parse_urdf(text)
