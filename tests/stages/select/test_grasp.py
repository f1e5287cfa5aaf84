"""Where the object sits in the person's hand, and that the tool centre point follows it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.config.yaml_file import parse_config
from besman.exceptions import ConfigError
from besman.geometry.frames import hand_frame, rotation_to_quaternion
from besman.records import HandTrajectory, LabelledRecording
from besman.robot.model import load_robot
from besman.stages.map.demonstration import tool_poses
from besman.stages.select.hand_trajectory import map_record
from besman.stages.select.stage import SelectConfig

ROBOT = load_robot("ur5", "stick_holder")
BALL_M = (0.05, -0.02, -0.07)


def recording_with_ball():
    """A hand that turns and moves, with a marker on a ball that it holds."""
    time = np.arange(0, 2, 0.01)
    turn = Rotation.from_rotvec(np.outer(np.sin(3 * time), [0.5, 0.8, -0.3]))
    place = np.stack([0.3 * np.sin(time), -0.4 + 0 * time, 0.2 * time], axis=1)
    hand = [[0.04, 0, 0], [-0.02, 0.03, 0], [-0.02, -0.03, 0], BALL_M]
    moving = np.stack([place + turn.apply(point) for point in hand], axis=1)
    back = np.tile([[0.0, 0, 0.08], [0, 0.06, -0.04], [0, -0.06, -0.04]], (len(time), 1, 1))
    names = ("back_top", "back_left", "back_right", "hand_top", "hand_left", "hand_right", "ball")
    positions = np.concatenate([back, moving], axis=1)
    return LabelledRecording(time, positions, names, np.zeros((200, 7)), 100.0, "a.tsv")


def test_the_tool_centre_point_follows_the_ball():
    stage = SelectConfig(label="throw", object_in_hand_m=BALL_M)
    recording = recording_with_ball()
    hand = map_record(
        recording, (20, 121), "throw", name="a", cutoff_hz=1000, rate_hz=100, grasp=stage.grasp
    )
    poses = tool_poses(hand, ROBOT)
    np.testing.assert_allclose(poses[:, :3, 3], recording.marker("ball")[20:121], atol=1e-9)
    # How it is turned the tool still says.
    own = tool_poses(HandTrajectory(hand.time, hand.poses, "a", "throw"), ROBOT)
    np.testing.assert_allclose(poses[:, :3, :3], own[:, :3, :3], atol=1e-12)
    assert np.linalg.norm(poses[0, :3, 3] - own[0, :3, 3]) > 0.05


def test_the_tool_turns_with_the_object():
    turn = Rotation.from_euler("xyz", [0.4, -0.7, 1.1])
    stage = SelectConfig(
        label="throw", object_in_hand_wxyz=tuple(3.0 * turn.as_quat(scalar_first=True))
    )
    poses = np.array([[0.1, 0.2, 0.3, 1.0, 0, 0, 0]] * 3)
    poses[1:, 3:] = rotation_to_quaternion(
        Rotation.from_rotvec([[0, 0, 0.3], [0, 0, 0.6]]).as_matrix()
    )
    hand = HandTrajectory([0, 0.1, 0.2], poses, "a", "throw", grasp=stage.grasp)
    asked = tool_poses(hand, ROBOT)
    for pose, angle in zip(asked, (0.0, 0.3, 0.6), strict=True):
        expected = Rotation.from_euler("z", angle) * turn
        np.testing.assert_allclose(pose[:3, :3], expected.as_matrix(), atol=1e-9)
    # Where it is the tool still says.
    np.testing.assert_allclose(asked[0, :3, 3], [0.1, 0.2, 0.3] + ROBOT.tool.tcp2hand[:3, 3])


def test_without_a_grasp_the_tool_says_everything():
    assert np.isnan(SelectConfig(label="throw").grasp).all()
    poses = np.array([[0.1, 0.2, 0.3, 1.0, 0, 0, 0]] * 3)
    asked = tool_poses(HandTrajectory([0, 0.1, 0.2], poses, "a", "throw"), ROBOT)
    np.testing.assert_allclose(asked[0, :3, :3], ROBOT.tool.tcp2hand[:3, :3])


def test_the_axes_of_the_hand_are_those_that_are_documented():
    # Palm down, fingers forward (x), the person's left is y.
    rotation, origin = hand_frame([0.1, 0, 0], [0.0, 0.03, 0], [0.0, -0.03, 0])
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(origin, [0.1 / 3, 0, 0])


def test_a_grasp_that_cannot_be():
    for content, message in (
        ({"object_in_hand_wxyz": [0, 0, 0, 0]}, "object_in_hand_wxyz: .*a quaternion of zero"),
        ({"object_in_hand_m": [0, 0]}, "object_in_hand_m"),
        ({"longest_gap_s": -1}, "longest_gap_s: got -1"),
    ):
        with pytest.raises(ConfigError, match=message):
            parse_config({"label": "throw", **content}, SelectConfig, "p.yaml")
