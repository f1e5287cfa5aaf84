import numpy as np
import pytest

from besman.exceptions import RecognitionError
from besman.person.body import Arm, find_back, find_body

BACK = ("back_top", "back_left", "back_right")
ARM = ("hand_top", "elbow", "shoulder", "hand_left", "hand_right")


def test_one_arm_before_cameras():
    body = find_body((*BACK, *ARM), "a.tsv")
    cluster = ("hand_top", "hand_left", "hand_right")
    assert body.back == BACK
    assert body.arms == (Arm("hand_top", "elbow", "shoulder", cluster),)


@pytest.mark.parametrize("prefix", ["", "right_"])
def test_two_arms_before_cameras(prefix):
    names = (*BACK, *(f"{prefix}{n}" for n in ARM), *(f"left_{n}" for n in ARM))
    right, left = find_body(names, "a.tsv").arms
    assert right.hand == f"{prefix}hand_top"
    assert left.markers == ("left_hand_top", "left_elbow", "left_shoulder")
    body = find_body(names, "a.tsv")
    assert body.arms_of(("left_elbow",)) == (left,)
    assert body.arms_of(("left_elbow", right.hand)) == (right, left)
    assert body.arms_of(("back_top",)) == (right,)


def test_a_sensor_suit():
    limbs = ("hand", "fore_arm", "upper_arm", "shoulder")
    names = ("t8", *(f"{side}_{limb}" for side in ("right", "left") for limb in limbs))
    body = find_body(names, "a.mvnx")
    assert body.back == ("t8", "left_shoulder", "right_shoulder")
    assert [arm.hand for arm in body.arms] == ["right_hand", "left_hand"]
    assert body.arms[0].cluster == ()


def test_of_a_suit_without_shoulders_the_upper_arm_and_the_chest_do():
    names = ("t8", "right_hand", "right_fore_arm", "right_upper_arm")
    assert find_body(names, "a.mvnx").back == ("t8", "t8", "right_upper_arm")


def test_a_back_that_is_missing_is_refused():
    with pytest.raises(RecognitionError, match=r"a.tsv: no marker 'back_left': the person's frame"):
        find_body(("back_top", "back_right", *ARM), "a.tsv")


def test_an_arm_that_is_not_complete_is_refused():
    with pytest.raises(RecognitionError, match=r"a.tsv: no arm is complete: got back_top"):
        find_body((*BACK, "hand_top", "elbow"), "a.tsv")


LIMBS = ("wrist", "elbow", "shoulder")


def test_an_exoskeleton():
    names = tuple(f"{side}_{limb}" for side in ("right", "left") for limb in LIMBS)
    body = find_body(names, "a.csv")
    assert body.back == ("right_shoulder", "left_shoulder", "right_shoulder")
    assert [arm.side for arm in body.arms] == ["right", "left"]
    with pytest.raises(RecognitionError, match=r"no marker 'left_shoulder': .*of an exoskeleton"):
        find_body(names[:3], "a.csv")


def test_what_tells_where_the_person_stands():
    assert find_back((*BACK, *ARM)) == BACK
    assert find_back(("t8", "right_upper_arm", "right_hand")) == ("t8", "t8", "right_upper_arm")
    assert find_back((*BACK[:2], *ARM)) == ()
    assert find_back(("right_wrist", "right_shoulder", "left_shoulder")) == ()


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_hand_of_a_suit_points_outwards_with_the_arm_stretched(side):
    limbs = ("hand", "fore_arm", "upper_arm")
    names = ("t8", *(f"{one}_{limb}" for one in ("right", "left") for limb in limbs))
    arm = next(arm for arm in find_body(names, "a").arms if arm.side == side)
    hand2lab = arm.turn(np.eye(3))
    np.testing.assert_array_equal(hand2lab[:, 0], [0, -1 if side == "right" else 1, 0])
    np.testing.assert_array_equal(hand2lab[:, 2], [0, 0, 1])
    assert np.linalg.det(hand2lab) == pytest.approx(1)
