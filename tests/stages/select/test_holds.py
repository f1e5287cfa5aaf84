"""When an object moves with the hand: against motions whose grasp and release are known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.stages.select.holds import REACH_M, find_holds

RATE_HZ = 60.0


def smooth(n):
    s = np.linspace(0, 1, n)
    return (10 * s**3 - 15 * s**4 + 6 * s**5)[:, np.newaxis]


def course(*pieces):
    """Go through points; each piece is (point, samples)."""
    path = [np.array(pieces[0][0])[np.newaxis]]
    for point, n in (piece for piece in pieces[1:] if piece[1]):
        path.append(path[-1][-1] + smooth(n) * (np.array(point) - path[-1][-1]))
    return np.concatenate(path)


def reach_carry_leave(turn=0.0, pause=0, noise=3e-4):
    """A hand that comes, carries a box for 60 samples, and goes; grasp and release rows."""
    hand = course(
        ((0, 0, 0), 1), ((0.5, 0, 0.2), 40), ((0.5, 0, 0.2), 20), ((0.5, 0.4, 0.4), 30),
        ((0.5, 0.4, 0.4), pause), ((0.2, 0.5, 0.0), 30), ((0.2, 0.5, 0.0), 20), ((0, 0, 0), 40),
    )  # fmt: skip
    grasp, release = 61, 121 + pause
    # Not stood still in: the hand turns about the vertical while it carries.
    angle = np.interp(np.arange(len(hand)), [grasp, release], [0, turn])
    hand2lab = Rotation.from_rotvec(angle[:, np.newaxis] * [0.0, 0.0, 1.0]).as_matrix()
    within = np.clip(np.arange(len(hand)), grasp, release)
    box = hand[within] + hand2lab[within] @ [0.2, 0.0, -0.05]
    rng = np.random.default_rng(0)
    return hand, box + rng.normal(scale=noise, size=box.shape), hand2lab, (grasp, release)


@pytest.mark.parametrize(("turn", "pause"), [(0.0, 0), (1.5, 0), (0.5, 10)])
def test_grasp_and_release_are_where_the_box_leaves_and_comes_to_stand(turn, pause):
    hand, box, hand2lab, true = reach_carry_leave(turn, pause)
    (found,) = find_holds(hand, box, RATE_HZ, hand2lab)
    # A minimum jerk takes a few samples to leave by three millimetres.
    assert np.abs(found - true).max() <= 6
    far = find_holds(hand + np.array([0.0, 0.0, REACH_M]), box, RATE_HZ, hand2lab)
    assert len(far) == 0


def test_a_hand_that_turns_on_the_spot_carries_what_it_holds_along():
    angle = 1.5 * np.concatenate([np.zeros(20), smooth(40)[:, 0], np.ones(20)])
    hand2lab = Rotation.from_rotvec(angle[:, np.newaxis] * [0.0, 0.0, 1.0]).as_matrix()
    hand, box = np.zeros((80, 3)), hand2lab @ [0.2, 0.0, 0.0]
    (found,) = find_holds(hand, box, RATE_HZ, hand2lab)
    assert np.abs(found - (20, 60)).max() <= 6
    assert len(find_holds(hand, box, RATE_HZ)) == 0


def test_a_box_that_stands_or_moves_by_itself_is_not_held():
    hand, box, hand2lab, _ = reach_carry_leave()
    assert len(find_holds(hand, np.broadcast_to(box[0], box.shape), RATE_HZ, hand2lab)) == 0
    assert len(find_holds(np.broadcast_to(hand[0], hand.shape), box, RATE_HZ)) == 0
    nudged = box[0] + course(((0, 0, 0), 1), ((0.02, 0, 0), len(box) - 1))
    assert len(find_holds(nudged + 0.1, nudged, RATE_HZ)) == 0


def test_a_box_that_is_thrown_is_let_go_where_it_parts():
    hand = course(((0, 0, 0), 1), ((0, 0, 0), 20), ((1.0, 0, 0), 40), ((1.0, 0, 0), 40))
    release = 41
    box = hand.copy()
    hand[release:] = hand[release]
    box[release:] = hand[release] + np.arange(len(hand) - release)[:, np.newaxis] * (
        hand[release] - hand[release - 1]
    )
    (found,) = find_holds(hand, box, RATE_HZ)
    assert abs(found[1] - release) <= 10


def test_what_is_not_seen_is_not_held():
    hand, box, hand2lab, _ = reach_carry_leave()
    assert len(find_holds(hand, np.full_like(box, np.nan), RATE_HZ, hand2lab)) == 0
    assert len(find_holds(hand[:5], box[:5], RATE_HZ)) == 0
