"""A person whose sides are known: built from joints, turned as a whole, exchanged by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.person.sides import find_exchanged, name_frames, weigh_back, weigh_hand

RATE_HZ = 100.0


def person(side, seed=0, n=400, roll_deg=0.0):
    """Markers by name of a person who turns about while an arm bends; 1 for the left arm.

    The forearm is turned by roll_deg from where the thumb is up, positive towards palm down.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(n) / RATE_HZ
    angle = np.radians(60.0 + 40.0 * np.sin(2.0 * time + seed))
    zero = 0.0 * time
    shoulder = np.stack([zero, zero + 0.2 * side, zero + 1.4], axis=1)
    elbow = shoulder - np.array([0.0, 0.0, 0.3])
    fore = np.stack([np.sin(angle), zero, -np.cos(angle)], axis=1)
    up = np.stack([np.cos(angle), zero, np.sin(angle)], axis=1)
    lateral = np.array([0.0, side, 0.0])
    roll = np.radians(roll_deg)
    back_of_hand = np.cos(roll) * lateral + np.sin(roll) * up
    to_left = np.cross(back_of_hand, fore)
    top = elbow + 0.36 * fore
    points = {
        "back_left": np.tile([-0.1, 0.06, 1.3], (n, 1)),
        "back_right": np.tile([-0.1, -0.06, 1.3], (n, 1)),
        "shoulder": shoulder,
        "elbow": elbow,
        "hand_top": top,
        "hand_left": top - 0.06 * fore + 0.03 * to_left,
        "hand_right": top - 0.06 * fore - 0.03 * to_left,
    }
    heading = 1.5 * np.sin(time + seed)
    turn = Rotation.from_rotvec(heading[:, np.newaxis] * [0.0, 0.0, 1.0])
    return {
        name: turn.apply(path) + rng.normal(scale=3e-4, size=path.shape)
        for name, path in points.items()
    }


def exchanged(points, one, two, rows=slice(None)):
    result = {name: path.copy() for name, path in points.items()}
    result[one][rows], result[two][rows] = points[two][rows], points[one][rows]
    return result


def of_hand(points, side):
    hand = tuple(points[f"hand_{part}"] for part in ("top", "left", "right"))
    weight = weigh_hand(hand, points["elbow"], points["shoulder"], side)
    return weight, find_exchanged(hand[1], hand[2], weight, RATE_HZ)


def of_back(points, side):
    left, right = points["back_left"], points["back_right"]
    weight = weigh_back(left, right, points["shoulder"], side)
    return weight, find_exchanged(left, right, weight, RATE_HZ)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("seed", range(5))
def test_the_shoulder_says_which_side_of_the_back_is_which(side, seed):
    points = person(side, seed)
    weight, found = of_back(points, side)
    assert weight.min() > 0.7
    assert not found.any()
    weight, found = of_back(exchanged(points, "back_left", "back_right"), side)
    assert weight.max() < -0.7
    assert found.all()


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("roll_deg", [-60.0, -30.0, 0.0, 30.0, 60.0])
def test_the_elbow_says_which_side_of_the_hand_is_which(side, roll_deg):
    points = person(side, roll_deg=roll_deg)
    weight, found = of_hand(points, side)
    np.testing.assert_allclose(np.median(weight), np.cos(np.radians(roll_deg)), atol=0.03)
    assert not found.any()
    weight, found = of_hand(exchanged(points, "hand_left", "hand_right"), side)
    np.testing.assert_allclose(np.median(weight), -np.cos(np.radians(roll_deg)), atol=0.03)
    assert found.all()


def test_a_palm_that_faces_down_says_nothing_of_the_whole():
    points = person(-1.0, roll_deg=90.0)
    assert not of_hand(points, -1.0)[1].any()
    assert not of_hand(exchanged(points, "hand_left", "hand_right"), -1.0)[1].any()


@pytest.mark.parametrize("roll_deg", [0.0, 90.0])
@pytest.mark.parametrize("rows", [slice(100, 140), slice(0, 40), slice(360, 400), slice(7, 8)])
def test_an_exchange_for_a_time_is_found_to_the_frame(roll_deg, rows):
    points = exchanged(person(-1.0, 3, roll_deg=roll_deg), "hand_left", "hand_right", rows)
    expected = np.zeros(400, dtype=bool)
    expected[rows] = True
    np.testing.assert_array_equal(of_hand(points, -1.0)[1], expected)


def test_an_exchange_behind_a_long_gap_is_found_by_the_shoulder():
    points = exchanged(person(-1.0), "back_left", "back_right", slice(220, 400))
    for name in ("back_left", "back_right"):
        points[name][180:220] = np.nan
    expected = np.zeros(400, dtype=bool)
    expected[220:] = True
    np.testing.assert_array_equal(of_back(points, -1.0)[1], expected)


def test_nothing_seen_and_nothing_known():
    blind = np.full((50, 3), np.nan)
    assert not find_exchanged(blind, blind, np.full(50, np.nan), RATE_HZ).any()
    points = person(-1.0)
    stretched = {**points, "hand_top": points["elbow"] + points["elbow"] - points["shoulder"]}
    assert np.isnan(of_hand(stretched, -1.0)[0]).all()


def test_frames_are_named_as_in_the_file():
    mask = np.zeros(60, dtype=bool)
    mask[[3, 10, 11, 20, 30, 40, 50]] = True
    assert name_frames(mask, 100) == "103, 110 to 111, 120, 130 and 2 more stretches"
    assert name_frames(mask[:15], 0) == "3, 10 to 11"
