"""A placed body against its own arm kinematics and a mirror."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.geometry.frames import quaternion_to_rotation
from besman.synthetic.body import LEFT, RIGHT, join_bodies, place_body
from besman.synthetic.person import HAND_MARKERS, draw_person, move_arm
from besman.synthetic.stance import Stance

N = 30
TIME = np.arange(N) / 100
LOW = np.array([-0.5, -0.9, -0.5, 0.4, 0.2, -0.5, -0.5])
HIGH = np.array([1.8, 0.0, 1.5, 2.4, 1.6, 0.5, 0.5])


@pytest.fixture(scope="module")
def person():
    return draw_person(np.random.default_rng(4))


@pytest.fixture(scope="module")
def joints():
    return np.random.default_rng(5).uniform(LOW, HIGH, (N, 7))


def stance(turn_deg=0.0, place=(0.0, 0, 0)):
    still = np.zeros((2, 3))
    heading = Rotation.from_euler("Z", turn_deg, degrees=True)
    return Stance(heading, np.array(place), still, still, still)


def upright(person, joints, **where):
    return place_body(person, stance(**where), Rotation.identity(N), joints, TIME)


def test_the_hand_is_where_the_arm_puts_it(person, joints):
    body = upright(person, {RIGHT: joints})
    arm = move_arm(person, joints)
    np.testing.assert_allclose(body.hands[RIGHT][:, :3], person.shoulder + arm.hand, atol=1e-12)
    hand2lab = quaternion_to_rotation(body.hands[RIGHT][:, 3:])
    np.testing.assert_allclose(hand2lab, arm.hand2torso, atol=1e-12)
    for name, offset in HAND_MARKERS.items():
        expected = body.hands[RIGHT][:, :3] + hand2lab @ offset
        np.testing.assert_allclose(body.markers[name], expected, atol=1e-12)


def test_turning_and_placing_the_person_turns_and_places_all_markers(person, joints):
    there = {"turn_deg": 40.0, "place": (1.0, -0.5, 0.0)}
    body, moved = (upright(person, {RIGHT: joints}, **where) for where in ({}, there))
    turn = Rotation.from_euler("Z", 40.0, degrees=True)
    for name, path in body.markers.items():
        np.testing.assert_allclose(moved.markers[name], turn.apply(path) + there["place"])
    np.testing.assert_allclose(
        moved.capsules.ends.reshape(-1, 3),
        turn.apply(body.capsules.ends.reshape(-1, 3)) + there["place"],
    )


def test_a_left_arm_is_a_right_one_in_a_mirror(person, joints):
    body = upright(person, {RIGHT: joints, LEFT: joints})
    for name, path in body.markers.items():
        if name.startswith("left_"):
            other = name.replace("left_", "right_", 1)
            # Left and right of the hand are seen from above: the mirror swaps them.
            swapped = {"hand_left": "hand_right", "hand_right": "hand_left"}
            part = other.removeprefix("right_")
            other = f"right_{swapped.get(part, part)}"
            np.testing.assert_allclose(path, body.markers[other] * [1, -1, 1], atol=1e-12)


def test_limbs_keep_their_lengths_and_their_markers_stay_outside(person, joints):
    capsules = upright(person, {RIGHT: joints}).capsules
    length = np.linalg.norm(capsules.ends - capsules.starts, axis=2)
    np.testing.assert_allclose(length, length[:1].repeat(N, axis=0), atol=1e-9)
    at = capsules.names.index("right_forearm")
    np.testing.assert_allclose(length[:, at], person.forearm_m)
    body = upright(person, {RIGHT: joints})
    way = capsules.ends[:, at] - capsules.starts[:, at]
    off = body.markers["elbow"] - capsules.starts[:, at]
    share = np.clip((off * way).sum(axis=1) / (way**2).sum(axis=1), 0, 1)
    apart = np.linalg.norm(off - share[:, None] * way, axis=1)
    assert (apart > capsules.radii[at]).all()


def test_joined_stretches_are_the_whole(person, joints):
    whole = upright(person, {RIGHT: joints})
    parts = [
        place_body(person, stance(), Rotation.identity(stop - start), {RIGHT: joints[start:stop]},
                   TIME[start:stop])
        for start, stop in ((0, 11), (11, N))
    ]  # fmt: skip
    joined = join_bodies(parts)
    for name in whole.markers:
        np.testing.assert_allclose(joined.markers[name], whole.markers[name], atol=1e-12)
    np.testing.assert_allclose(joined.capsules.starts, whole.capsules.starts, atol=1e-12)
    np.testing.assert_allclose(joined.joints[RIGHT], joints)
    np.testing.assert_allclose(joined.parts["right_hand"][1], whole.parts["right_hand"][1])
