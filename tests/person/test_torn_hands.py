import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.person.torn_hands import find_torn, find_turned_over, hold_to_forearm

RATE_HZ = 60.0
FINGERS = np.array([[0.08, 0.03, 0.0], [0.09, -0.03, 0.0]])  # thumb and little, in the hand's axes


def arm(n=120, seed=0, noise_m=0.0):
    """Shoulder, elbow, wrist and two knuckles of an arm that swings; the hand is the forearm's."""
    t = np.arange(n) / RATE_HZ
    rng = np.random.default_rng(seed)
    shoulder = np.tile([0.0, -0.2, 1.4], (n, 1))
    upper = Rotation.from_euler("YZ", np.stack([1.2 + 0.5 * np.sin(4 * t), 0.6 * t], axis=1))
    fore = upper * Rotation.from_rotvec(np.outer(-0.9 - 0.4 * np.cos(3 * t), [0, 1, 0]))
    elbow = shoulder + upper.apply([0.3, 0.0, 0.0])
    wrist = elbow + fore.apply([0.27, 0.0, 0.0])
    points = wrist[:, None] + np.stack([fore.apply(one) for one in FINGERS], axis=1)
    parts = (shoulder, elbow, wrist, points)
    return [part + rng.normal(0.0, noise_m, part.shape) for part in parts]


@pytest.mark.parametrize("noise_m", [0.0, 0.02])
def test_a_hand_that_is_one_is_let_be(noise_m):
    _, elbow, wrist, points = arm(noise_m=noise_m)
    torn = find_torn(elbow, wrist, points, RATE_HZ)
    assert torn.points.mean() < 0.005
    assert not torn.wrist.any()
    assert find_turned_over(points[:, 0], points[:, 1], RATE_HZ).over.mean() < 0.05


def test_a_knuckle_on_another_part_is_found_with_the_way_there():
    _, elbow, wrist, points = arm()
    points[40:46, 1] = elbow[40:46] + np.array([0.0, 0.0, 0.05])
    torn = find_torn(elbow, wrist, points, RATE_HZ)
    assert np.flatnonzero(torn.points[:, 1]).tolist() == list(range(38, 48))
    assert not torn.points[:, 0].any()
    assert not torn.wrist.any()


def test_a_wrist_that_is_off_is_told_from_a_whole_hand_that_is():
    _, elbow, wrist, points = arm()
    wrist[20:24] += [0.0, 0.3, 0.2]
    points[70:75] += [0.0, 0.3, 0.2]
    torn = find_torn(elbow, wrist, points, RATE_HZ)
    assert np.flatnonzero(torn.wrist).tolist() == list(range(18, 26))
    assert np.flatnonzero(torn.points.all(axis=1)).tolist() == list(range(68, 77))


def test_no_hand_is_longer_than_a_hand_though_it_is_so_most_of_the_time():
    _, elbow, wrist, points = arm()
    points[:80] += [0.0, 0.3, 0.2]
    assert find_torn(elbow, wrist, points, RATE_HZ).points[:80].all()


def test_sides_taken_for_each_other_are_found_and_a_hand_that_turns_over_is_not():
    _, _, _, points = arm()
    points[50:58] = points[50:58, ::-1]
    # Smoothed: on the way thumb and little finger are one.
    points[[49, 58]] = points[[49, 58]].mean(axis=1, keepdims=True)
    found = find_turned_over(points[:, 0], points[:, 1], RATE_HZ)
    assert np.flatnonzero(found.over).tolist() == list(range(50, 58))
    assert np.flatnonzero(found.on_the_way).tolist() == [49, 58]
    # In a fifth of a second, as fast as a forearm can: and back later.
    angle = np.interp(np.arange(120), [40, 52, 60, 72], [0.0, np.pi, np.pi, 0.0])
    turned = Rotation.from_rotvec(np.outer(angle, [1, 0, 0]))
    thumb, little = (turned.apply(one) for one in FINGERS)
    assert not np.any(find_turned_over(thumb, little, RATE_HZ))


def test_fingers_go_along_with_the_forearm():
    shoulder, elbow, wrist, points = arm()
    spoilt = points.copy()
    spoilt[30:70, 0] = spoilt[100:, 1] = np.nan
    found, held = hold_to_forearm(shoulder, elbow, wrist, spoilt)
    # The hand is the forearm's own, so that what was hidden comes back.
    np.testing.assert_allclose(found, points, atol=1e-12)
    assert np.flatnonzero(held).tolist() == [*range(30, 70), *range(100, 120)]
    wrist[40] = np.nan
    found, held = hold_to_forearm(shoulder, elbow, wrist, spoilt)
    assert np.isnan(found[40, 0]).all()
    assert not held[40]


def test_an_arm_that_is_straight_all_the_time_holds_no_finger():
    shoulder, elbow, wrist, points = arm(20)
    wrist = elbow + (elbow - shoulder)
    points[5] = np.nan
    found, held = hold_to_forearm(shoulder, elbow, wrist, points)
    assert np.isnan(found[5]).all()
    assert not held.any()
