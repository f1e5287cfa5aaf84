"""Where a hand holds a thing, between thumb and fingers."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from whole_task import divide_actions, make_select, record_take

from besman.stages.select.finger_frame import finger_frame, turn_to_fingers
from besman.stages.select.hand_motion import hand_motion


def hands_and_tips(turn, thumb, fingers, n=9):
    """A hand that wanders, level turns of it, and tips that stand still in it."""
    draw = np.random.default_rng(3)
    hands = draw.normal(size=(n, 3))
    about = Rotation.from_euler("z", draw.uniform(-1, 1, (n, 1)))
    turns = (about * turn).as_matrix()
    tips = np.stack([hands + turns @ np.array(one) for one in (thumb, fingers)], axis=1)
    return tips, turns, hands


def test_it_is_level_and_across_the_fingers_whatever_the_hand_does():
    turn = Rotation.from_euler("y", 0.6)
    tips, turns, hands = hands_and_tips(turn, (0.1, 0.06, -0.02), (0.12, -0.05, -0.02))
    frame = finger_frame(tips, turns, hands)
    np.testing.assert_allclose(frame[:3, :3].T @ frame[:3, :3], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(frame[:3, 3], [0.11, 0.005, -0.02])
    across = np.array([-0.02, 0.11, 0.0])
    np.testing.assert_allclose(frame[:3, 1], across / np.linalg.norm(across), atol=1e-12)
    for one in turns:
        assert (one @ frame[:3, 0])[2] == pytest.approx(0.0, abs=1e-12)
    assert frame[:3, 0] @ frame[:3, 3] > 0


def test_a_tip_that_jumps_once_and_one_unseen_change_nothing():
    tips, turns, hands = hands_and_tips(Rotation.identity(), (0.1, 0.06, 0), (0.1, -0.06, 0))
    expected = finger_frame(tips, turns, hands)
    tips[2, 0] += 0.5
    tips[5] = np.nan
    np.testing.assert_allclose(finger_frame(tips, turns, hands), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("thumb", "fingers"),
    [
        ((0.1, 0.001, 0), (0.1, 0, 0)),
        ((0.1, 0, 0.05), (0.1, 0, -0.05)),
        ((np.nan,) * 3, (0.1, -0.05, 0)),
    ],
    ids=["closed", "above each other", "unseen"],
)
def test_what_tells_nothing_gives_nothing(thumb, fingers):
    assert finger_frame(*hands_and_tips(Rotation.identity(), thumb, fingers)) is None


def test_the_tool_follows_the_middle_of_the_fingers_while_the_box_is_held():
    """The frame's origin in the recording is where thumb and fingers are (synthetic)."""
    recording, blocks = record_take()
    (one,) = divide_actions(recording, blocks, make_select())
    hand = one.hand
    assert np.isfinite(hand.grasp[:3]).all()
    assert np.isnan(hand.grasp[3:]).all()
    centre, _ = hand_motion(recording, (0, len(recording.time)), "right")
    fingers = np.mean([recording.marker("index"), recording.marker("middle")], axis=0)
    middle = 0.5 * (recording.marker("thumb") + fingers)
    start = blocks.bounds[blocks.labels.index("approach_forward"), 0]
    first, last = (start + np.round(one.holds_s[0] * recording.rate_hz)).astype(int)
    apart = np.linalg.norm(middle - centre, axis=1)[first:last]
    assert np.linalg.norm(hand.grasp[:3]) == pytest.approx(np.median(apart), abs=0.005)


def test_a_recipe_that_says_where_the_thing_is_is_kept():
    recording, _ = record_take()
    hand = SimpleNamespace(grasp=np.zeros(7))
    eyes = np.tile(np.eye(3), (9, 1, 1))
    assert turn_to_fingers(hand, recording, (np.zeros((9, 3)), eyes), 0, [(0, 9)], "") is hand
    hand = SimpleNamespace(grasp=np.full(7, np.nan))
    assert turn_to_fingers(hand, recording, (np.zeros((9, 3)), None), 0, [(0, 9)], "") is hand
    assert turn_to_fingers(hand, recording, (np.zeros((9, 3)), eyes), 0, [], "") is hand
