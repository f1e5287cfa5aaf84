"""Which hinges are the arm's: descriptions of every kind, small."""

from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

from besman.exceptions import RobotError
from besman.robot.files.arm_base import mobile_base_joints, split_at_base
from besman.robot.files.arm_chain import find_chain, find_tip, held_joints

FILE = Path("arm.urdf")
SHAPE = "<visual><geometry><sphere radius='0.1'/></geometry></visual>"


def tree_of(*joints, bare=()):
    """Joints: (name, parent, child, type, master of a mimic); links have shapes but the bare."""
    links = dict.fromkeys(one for joint in joints for one in joint[1:3])
    text = "".join(f"<link name='{one}'>{'' if one in bare else SHAPE}</link>" for one in links)
    for name, parent, child, *more in joints:
        mimic = f"<mimic joint='{more[1]}'/>" if len(more) > 1 else ""
        text += (f"<joint name='{name}' type='{more[0] if more else 'revolute'}'>"
                 f"<parent link='{parent}'/><child link='{child}'/>{mimic}</joint>")  # fmt: skip
    return ElementTree.fromstring(f"<robot name='arm'>{text}</robot>")


def row(count, name="l", base="base", joint="j"):
    """Hinges in a row from a base: links l1, l2, ..."""
    links = [base, *(f"{name}{index + 1}" for index in range(count))]
    return [(f"{joint}{name}{i}", *ends) for i, ends in enumerate(pairwise(links))]


def found(*joints, base=None, bare=()):
    tree = tree_of(*joints, bare=bare)
    tip = find_tip(tree, FILE, base)
    return tip, len(find_chain(tree, tip, FILE, base))


@pytest.mark.parametrize(
    ("end", "tip", "hinges"),
    [
        # A wrist that turns a gripper as a whole, with its fingers or without.
        ([("wrist_rotate", "l5", "gripper_link")], "gripper_link", 6),
        ([("turn", "l5", "gripper_link"), ("a", "gripper_link", "left_finger", "prismatic"),
          ("b", "gripper_link", "right_finger", "prismatic")], "gripper_link", 6),
        ([("roll", "l5", "palm"), ("jaw", "palm", "moving_jaw")], "palm", 6),
        # A gripper's one motor, and what follows it.
        ([("mount", "l5", "gripper_base", "fixed"), ("drive", "gripper_base", "outer_knuckle"),
          ("a", "outer_knuckle", "left_finger", "revolute", "drive"),
          ("b", "gripper_base", "right_finger", "revolute", "drive")], "gripper_base", 5),
        ([("point", "l5", "gripper_tcp", "fixed"), ("six", "l5", "gripper")],
         "gripper_tcp", 5),
        ([("fixed_jaw", "l5", "jaw", "fixed"), ("gripper", "l5", "moving")], "l5", 5),
        # A hand: its thumb is longer than its fingers.
        ([("mount", "l5", "hand", "fixed"), *row(2, "t", "hand"), *row(1, "a", "hand"),
          *row(1, "b", "hand"), *row(1, "c", "hand")], "hand", 5),
        ([("mount", "l5", "tool0", "fixed"), ("m", "tool0", "hand", "fixed"),
          *(one for name in "abcde" for one in row(7, name, "hand"))], "tool0", 5),
    ],
)  # fmt: skip
def test_where_the_arm_ends(end, tip, hinges):
    assert found(*row(5), *end) == (tip, hinges)


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        # A quadruped, two arms on a torso that is long itself, a hand, a head and wheels.
        ([one for name in "abcd" for one in row(3, name)],
         r"more than one chain could be the arm; give one of --tip a3 \(3 hinges\), --tip b3"),
        ([*row(5), *row(7, "left", "l5"), *row(7, "right", "l5"), *row(2, "head", "l5")],
         r"one of --tip left7 \(12 hinges\), --tip right7 \(12 hinges\), --tip head2"),
        ([*row(2, "t"), *row(1, "a"), *row(1, "b"), *row(1, "c")],
         r"the longest chain has 2 hinges \(--tip t2\), and 3 more joints move beside it; expect"),
        ([*row(2, "head"), *row(1, "wheel")], "longest chain has 2 hinges .*or --tip LINK"),
        ([("x", "base", "a", "prismatic")], "no hinge moves any link; expected an arm"),
        ([("x", "base", "a", "fixed")], "no hinge moves any link; expected an arm"),
        ([("finger_0", "base", "a"), ("finger_1", "a", "b")],
         r"no hinge moves any link; expected an arm but fingers.* \(finger_0, finger_1\); or"),
    ],
)  # fmt: skip
def test_what_is_no_arm_says_what_is_possible(joints, message):
    with pytest.raises(RobotError, match=message):
        found(*joints)


DRIVES = [("x", "world", "a", "prismatic"), ("y", "a", "b", "prismatic"),
          ("turn", "b", "base", "continuous")]  # fmt: skip


def test_what_drives_a_base_about_is_held():
    joints, bare = [*DRIVES, *row(6)], ("world", "a", "b")
    assert found(*joints, bare=bare) == ("l6", 6)
    held = held_joints(tree_of(*joints, bare=bare), "l6", FILE)
    assert [one.get("name") for one in held] == ["x", "y", "turn"]
    # The root as the base: nothing of it is left out but what slides.
    assert found(*joints, base="world", bare=bare) == ("l6", 7)
    # Without a sliding joint, or without any shape, there is nothing to tell them by.
    turning = [("turn", "world", "base"), *row(6)]
    assert found(*turning, bare=("world",)) == ("l6", 7)
    # The arm's first hinge is none of it, whether or not its base has a shape.
    turn, again = DRIVES[2], ("again", *DRIVES[2][1:])
    for order in (DRIVES, [turn, *DRIVES[:2]], [turn, DRIVES[0], again]):
        names = [name for name, *_ in order]
        chain = [(name, *ends, kind) for (name, _, _, kind), ends in
                 zip(order, [("world", "a"), ("a", "b"), ("b", "base")], strict=True)]  # fmt: skip
        tree = tree_of(*chain, *row(6), bare=("world", "a", "b", "base"))
        assert mobile_base_joints(tree) == set(names)
    # Where only a hand has shapes, the slides of its fingers make no base of the arm below it.
    slides = [(name, "l7", name, "prismatic") for name in ("finger_l", "finger_r")]
    shapeless = ["base", *(f"l{index + 1}" for index in range(7))]
    assert mobile_base_joints(tree_of(*row(7), *slides, bare=shapeless)) == set()
    links = {one for joint in joints for one in joint[1:3]}
    assert mobile_base_joints(tree_of(*joints, bare=links)) == set()


def test_what_slides_beside_an_arm_is_no_base_of_it():
    # A scene: the arm and what it is to push hang on the same world.
    pushed = [("x", "base", "rail", "prismatic"), ("y", "rail", "ball", "prismatic")]
    for joints in ([*pushed, *row(6)], [*row(6), *pushed]):
        tree = tree_of(*joints, bare=("base", "rail"))
        assert mobile_base_joints(tree) == {"x", "y"}
        assert found(*joints, bare=("base", "rail")) == ("l6", 6)
        assert held_joints(tree, "l6", FILE) == []


def test_a_base_that_is_given():
    torso = [("lift", "floor", "torso", "prismatic"), ("waist", "torso", "base")]
    two = [*torso, *row(6, "left"), *row(6, "right")]
    assert found(*torso, *row(6)) == ("l6", 7)
    assert found(*torso, *row(6), base="base") == ("l6", 6)
    tree = tree_of(*two)
    assert [one.get("name") for one in held_joints(tree, "left6", FILE, "base")] == [
        "lift", "waist"]  # fmt: skip
    assert len(find_chain(tree, "left6", FILE, "base")) == 6
    below, rest = split_at_base(tree, "left6", FILE, "left2")
    assert (len(below), len(rest)) == (4, 4)
    with pytest.raises(RobotError, match=r"base: no link 'bas'; did you mean 'base'"):
        find_tip(tree, FILE, "bas")
    with pytest.raises(RobotError, match=r"base: no link 'bas'; did you mean 'base'"):
        find_chain(tree, "left6", FILE, "bas")
    message = (
        r"base: link 'right3' is not between the root and the tip 'left6'; expected one of floor, "
        r"torso, base, left1"
    )
    with pytest.raises(RobotError, match=message):
        find_chain(tree, "left6", FILE, "right3")
    with pytest.raises(RobotError, match="tip: no joint moves the link 'floor'"):
        find_chain(tree, "floor", FILE)
    with pytest.raises(RobotError, match="expected one of none, the tip is the root"):
        find_chain(tree, "floor", FILE, "floor")
