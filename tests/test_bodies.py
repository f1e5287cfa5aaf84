import pytest

from besman.bodies import Arm, find_body
from besman.exceptions import RecognitionError

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
