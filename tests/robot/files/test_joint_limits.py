"""Limits that are given, and such that are not."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest

from besman.exceptions import RobotError
from besman.robot.files.joint_limits import assume_torques, parse_limit_list, read_joints


def joint(kind, **limit):
    words = " ".join(f'{key}="{value}"' for key, value in limit.items())
    inside = f"<limit {words}/>" if limit else ""
    return ElementTree.fromstring(f'<joint name="j" type="{kind}">{inside}</joint>')


@pytest.mark.parametrize(
    ("element", "position", "note"),
    [
        (joint("continuous"), [-360, 360], "which is continuous"),
        (joint("revolute", lower=-1, upper=1), [-57.29578, 57.29578], None),
        (joint("revolute", upper=1), [0, 57.29578], None),
        (joint("revolute", effort=3), [-180, 180], "position of j: -180 to 180 degrees, not given"),
        (joint("revolute", lower=0, upper=0), [-180, 180], "not given"),
        (joint("revolute", lower=-1e16, upper=1e16), [-360, 360], "no limit is given"),
    ],
)
def test_positions(element, position, note):
    (found,), assumed = read_joints([element], Path("a.urdf"), None, None)
    assert found["position_deg"] == pytest.approx(position)
    assert (note is None) != any(note in one for one in assumed if note)


def test_speeds_and_torques():
    given = joint("revolute", lower=-1, upper=1, velocity=2, effort=30)
    (found,), assumed = read_joints([given], Path("a.urdf"), [10.0], [10.0])
    assert found["velocity_deg_s"] == pytest.approx(np.degrees(2))
    assert found["torque_nm"] == 30
    assert assumed == ["accelerations of all joints"]
    for speed, effort in ((0, 0), (1e9, 1e9)):
        bare = joint("revolute", lower=-1, upper=1, velocity=speed, effort=effort)
        (found,), assumed = read_joints([bare], Path("a.urdf"), None, None)
        assert (found["velocity_deg_s"], found["torque_nm"]) == (120, None)
        assert assumed[0] == "speed of j: 120 degrees/s, not given"
        (found,), _ = read_joints([bare], Path("a.urdf"), [10.0], [20.0])
        assert (found["velocity_deg_s"], found["torque_nm"]) == (10, 20)


@pytest.mark.parametrize("word", ["nan", "x", "-1", ""])
def test_limits_that_are_none(word):
    bad = joint("revolute", lower=-1, upper=1, velocity=word, effort=1)
    with pytest.raises(RobotError, match=r"a.urdf: joint j: <limit> velocity: got"):
        read_joints([bad], Path("a.urdf"), None, None)


def test_lists_of_the_command_line():
    assert parse_limit_list(None, "--torque", "ab") is None
    assert parse_limit_list("3", "--torque", "ab") == [3, 3]
    assert parse_limit_list("3, 4.5", "--torque", "ab") == [3, 4.5]
    with pytest.raises(RobotError, match=r"--torque: got '1,2,3', expected one number above 0"):
        parse_limit_list("1,2,3", "--torque", "ab")


def test_an_arm_of_unknown_strength_carries_a_load_too():
    model = pinocchio.Model()
    hinge = model.addJoint(
        0, pinocchio.JointModelRY(), pinocchio.SE3.Identity(), "j",
        np.full(1, 9.0), np.full(1, 9.0), np.full(1, -np.pi), np.full(1, np.pi),
    )  # fmt: skip
    link = pinocchio.Inertia(2.0, np.array([0.5, 0.0, 0.0]), np.zeros((3, 3)))
    model.appendBodyToJoint(hinge, link, pinocchio.SE3.Identity())
    flange = pinocchio.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    model.addFrame(pinocchio.Frame("tip", hinge, 0, flange, pinocchio.FrameType.BODY))
    joints = [{"name": "j", "torque_nm": None}]
    (note,) = assume_torques(joints, model, [10.0], "tip", 1.0)
    # 2 kg half a metre away, and a tenth of that 0.1 m ahead of the flange and 0.1 m beside it.
    away = np.hypot(1.1, 0.1)
    weight = 9.81 * (2.0 * 0.5 + 0.2 * away)
    expected = 1.5 * (weight + 10.0 * (2.0 * 0.5**2 + 0.2 * away**2))
    assert joints[0]["torque_nm"] == pytest.approx(expected, rel=0.03)
    assert "the weight of the arm and of 0.2 kg" in note
    assert model.nbodies == 2
    assert model.inertias[1].mass == 2.0
