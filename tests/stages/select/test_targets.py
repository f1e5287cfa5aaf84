from dataclasses import replace

import numpy as np
import pytest
from free_throws import label_throws, write_throws
from pydantic import ValidationError

from besman.config.stage import Truth
from besman.exceptions import MappingError
from besman.geometry.frames import back_frame, quaternion_to_rotation
from besman.records import LabelledRecording, Landing
from besman.stages.recognize.one_throw import OneThrowConfig
from besman.stages.select.palm import turn_palm_to_push
from besman.stages.select.release import (
    HandPath,
    fall_to,
    landing_of_flight,
    landing_of_release,
    left_hand,
)
from besman.stages.select.stage import SelectConfig
from besman.stages.select.targets import Aim, find_target

RATE = 30.0
VELOCITY = np.array([3.0, 1.0, 4.0])
RELEASED = 1.0
HELD = np.array([0.0, 0.0, 2.0])


def make_throw(rate=RATE, noise=0.0, until=1.5):
    """A hand speeds up along a line to VELOCITY at 1 s, at (0, 0, 2), and stops; the ball flies."""
    time = np.arange(0, 2, 1 / rate)
    since = time - RELEASED
    way = np.where(since < 0, 0.5 * (np.maximum(since, -0.5) + 0.5) ** 2 / 0.5 - 0.25, 0.0)
    way += np.where(since > 0, since * np.exp(-since / 0.03), 0.0)
    hand = HELD + np.outer(way, VELOCITY)
    flown = np.outer(since, VELOCITY) - np.outer(since**2, [0.0, 0.0, 9.81 / 2])
    ball = np.where((since > 0)[:, None], HELD + flown, hand) + np.array([0.0, 0.0, 0.05])
    ball = ball + np.random.default_rng(0).normal(0, noise, ball.shape)
    ball[time > until] = np.nan
    filled = np.zeros((len(time), 1), dtype=bool)
    recording = LabelledRecording(time, ball[:, None], ("ball",), filled, rate, "a.json", 1)
    return recording, HandPath(time, hand, slice(int(0.4 * rate), int(1.3 * rate)))


def land(start, height=0.0):
    """Follow the flight in small steps."""
    place, velocity, step = np.array(start, dtype=float), VELOCITY.copy(), 1e-5
    while velocity[2] > 0 or place[2] > height:
        place += step * velocity
        velocity[2] -= 9.81 * step
    return place


@pytest.mark.parametrize("height", [0.0, 1.5])
def test_a_fall_is_that_of_small_steps(height):
    np.testing.assert_allclose(
        fall_to(np.array([0, 0, 2.0]), VELOCITY, height), land([0, 0, 2.0], height), atol=1e-3
    )


def test_a_height_that_is_not_reached_gives_no_place():
    assert np.isnan(fall_to(np.array([0, 0, 2.0]), VELOCITY, 3.0)).all()
    down = np.array([1.0, 0.0, -1.0])
    assert np.isnan(fall_to(np.array([0, 0, 2.0]), down, 2.04)).all()


@pytest.mark.parametrize(("rate", "noise"), [(24.0, 0.0), (30.0, 0.01), (1000.0, 0.01)])
def test_the_first_metres_tell_where_the_ball_comes_down(rate, noise):
    recording, hand = make_throw(rate, noise)
    found = landing_of_flight(recording, "ball", hand)
    np.testing.assert_allclose(found, land([0, 0, 2.05]), atol=0.02 if noise == 0 else 0.15)


def test_a_hand_that_is_fastest_after_it_let_go():
    recording, hand = make_throw(60.0)
    late = replace(hand, throw=slice(hand.release + round(0.3 * 60), len(hand.time)))
    assert late.release >= hand.release + 18
    found = landing_of_flight(recording, "ball", late)
    np.testing.assert_allclose(found, land([0, 0, 2.05]), atol=0.15)


def test_the_release_tells_where_it_would_come_down():
    _, hand = make_throw(1000.0)
    np.testing.assert_allclose(landing_of_release(hand), land([0, 0, 2.0]), atol=0.2)


def test_a_ball_that_bounces_is_followed_until_then():
    recording, hand = make_throw(100.0, until=2.0)
    positions = recording.positions.copy()
    positions[130:, 0] = positions[130, 0] + np.linspace(0, 1, 70)[:, None] * [-2.0, 0.0, 1.0]
    bounced = replace(recording, positions=positions)
    found = landing_of_flight(bounced, "ball", hand)
    np.testing.assert_allclose(found, land([0, 0, 2.05]), atol=0.2)


@pytest.mark.parametrize("until", [0.9, 1.1])
def test_too_few_sightings_give_no_place(until):
    recording, hand = make_throw(until=until)
    assert np.isnan(landing_of_flight(recording, "ball", hand)).all()


def test_filled_sightings_do_not_count():
    recording, hand = make_throw()
    guessed = replace(recording, filled=np.ones_like(recording.filled))
    assert np.isnan(landing_of_flight(guessed, "ball", hand)).all()


def test_a_ball_that_stays_in_the_hand_does_not_fly():
    recording, hand = make_throw(100.0)
    held = replace(recording, positions=hand.positions[:, None] + np.array([0.0, 0.0, 0.05]))
    assert not left_hand(held, "ball", hand).any()
    assert np.isnan(landing_of_flight(held, "ball", hand)).all()
    unseen = replace(recording, positions=np.full_like(recording.positions, np.nan))
    assert not left_hand(unseen, "ball", hand).any()


def test_a_ball_that_a_hand_brings_down_as_fast_as_it_falls_is_not_thrown():
    """A sinking hand: the fall is free, but the ball never left."""
    recording, hand = make_throw(100.0)
    positions = hand.positions[:, None].copy()
    since = np.clip(recording.time - 1.3, 0, 0.4)
    positions[:, 0, 2] -= 9.81 / 2 * since**2
    sinking = HandPath(hand.time, positions[:, 0], hand.throw)
    fallen = replace(recording, positions=positions)
    target, source = find_target(fallen, (40, 135), sinking, Aim(("object", "flight"), "ball"))
    assert np.isnan(target).all()
    assert source is None


def test_the_first_source_that_tells_a_place_counts():
    recording, hand = make_throw(100.0)
    landing = np.array([4.0, 1.0, 3.0])
    order = ("landing", "object", "flight", "release")
    target, source = find_target(recording, (40, 130), hand, Aim(order, "ball", landing))
    assert source == "landing"
    np.testing.assert_allclose(target, [4.0, 1.0, 0.0])
    assert find_target(recording, (40, 130), hand, Aim(order, "ball"))[1] == "object"
    # Smoothed too much to accelerate like a falling body, and for too short a time.
    short, hand = make_throw(noise=0.01, until=1.15)
    assert find_target(short, (12, 39), hand, Aim(order, "ball"))[1] == "flight"
    unseen, hand = make_throw(until=1.0)
    assert find_target(unseen, (12, 39), hand, Aim(order, "ball"))[1] == "release"
    assert find_target(unseen, (12, 39), hand, Aim())[1] is None


def test_a_target_is_brought_nearer_to_the_hand():
    recording, hand = make_throw(100.0)
    far, near = (
        find_target(recording, (40, 130), hand, Aim(("flight",), "ball", scale=scale))[0]
        for scale in (1.0, 0.25)
    )
    start = hand.positions[hand.release] * [1, 1, 0]
    np.testing.assert_allclose(near - start, 0.25 * (far - start), atol=1e-12)


def test_a_marker_that_is_not_there_is_not_passed_over():
    recording, hand = make_throw()
    with pytest.raises(MappingError, match="no marker 'basket' of a thrown object"):
        find_target(recording, (12, 39), hand, Aim(("flight", "release"), "basket"))


def test_the_palm_is_where_the_push_is():
    _, hand = make_throw(1000.0)
    time = np.array([0.45, 0.8])
    turn = turn_palm_to_push(hand, np.array([1.0, 0.0, 0.0]), time)
    np.testing.assert_allclose(turn @ turn.swapaxes(1, 2), np.tile(np.eye(3), (2, 1, 1)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(turn), 1.0)
    palm = -turn[:, :, 2]
    # At rest it carries; then it pushes along VELOCITY, at 1 m/s^2 for each m/s, and carries.
    np.testing.assert_allclose(palm[0], [0, 0, 1], atol=1e-3)
    push = 2 * VELOCITY + [0, 0, 9.81]
    np.testing.assert_allclose(palm[1], push / np.linalg.norm(push), atol=1e-2)
    # Fingers ahead and up to the sky: to the left of the hand's x is where y points, palm up.
    assert turn[0, :, 0] @ VELOCITY > 0


def test_a_throw_straight_up_faces_where_the_person_does():
    time = np.arange(0, 1, 0.01)
    hand = HandPath(time, np.outer(time**2, [0.0, 0.0, 1.0]), slice(0, 100))
    turn = turn_palm_to_push(hand, np.array([0.0, 1.0, 0.2]), time[:1])
    np.testing.assert_allclose(turn[0, :, 0], [0.0, 1.0, 0.0], atol=1e-9)


@pytest.fixture(scope="module")
def free_throws(tmp_path_factory):
    folder = tmp_path_factory.mktemp("throws")
    simulated = write_throws(folder, 3)
    recordings, segments = label_throws(folder)
    return simulated, recordings, OneThrowConfig().run(recordings, segments)


def in_court(hand, recording, segments):
    """Return the target in the laboratory frame."""
    start = segments.bounds[segments.labels.index("throw")][0]
    back = [recording.marker(f"back_{part}")[start] for part in ("top", "left", "right")]
    rotation, origin = back_frame(*back)
    return rotation @ hand.target + origin


@pytest.mark.parametrize("target", [None, "flight"])
def test_a_free_throw_is_aimed_at_where_its_ball_comes_down(free_throws, target):
    simulated, recordings, segments = free_throws
    stage = SelectConfig(label="throw", object="ball", cutoff_hz=6, palm="push", target=target)
    hands = stage.run(recordings, segments)
    for throw, hand, *one in zip(simulated, hands, recordings, segments, strict=True):
        np.testing.assert_allclose(in_court(hand, *one), throw.landing(), atol=0.6)
        # The palm never faces the floor.
        assert (-quaternion_to_rotation(hand.poses[:, 3:])[:, 2, 2]).min() > 0.15
    said = stage.figures(hands, Truth())["target"]
    assert set(said) == {hand.name for hand in hands}
    assert set(said.values()) <= ({"object", "flight"} if target is None else {target})


def test_a_landing_file_counts_before_what_is_seen(free_throws):
    _, recordings, segments = free_throws
    landings = (Landing("BB_FT_P0001_T0002", 1, np.array([12.0, 0.5, 3.0])),)
    stage = SelectConfig(label="throw", object="ball", landing="landings.csv")
    hands = stage.run(recordings, segments, landings)
    assert [hand.target_by == "landing" for hand in hands] == [False, True, False]
    place = in_court(hands[1], recordings[1], segments[1])
    # The floor below; noise turns the back's frame, which `in_court` takes unfiltered.
    np.testing.assert_allclose(place, [12.0, 0.5, 0.0], atol=0.05)
    alone = SelectConfig(label="throw", target="landing", landing="landings.csv")
    aimed = [np.isfinite(one.target).all() for one in alone.run(recordings, segments, landings)]
    assert aimed == [False, True, False]


def test_a_landing_of_the_recordings_own_counts_before_what_is_seen(free_throws):
    _, recordings, segments = free_throws
    landings = (Landing(recordings[1].source, 1, np.array([12.0, 0.5, 3.0])),)
    hands = SelectConfig(label="throw", object="ball").run(recordings, segments, landings)
    assert [hand.target_by == "landing" for hand in hands] == [False, True, False]


def test_without_a_ball_the_release_is_asked(free_throws):
    _, recordings, segments = free_throws
    hands = SelectConfig(label="throw", target="release").run(recordings, segments)
    assert {hand.target_by for hand in hands} == {"release"}
    none = SelectConfig(label="throw").run(recordings, segments)
    assert {hand.target_by for hand in none} == {None}


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("flight", "target: flight needs select.object, the marker of what is thrown"),
        ("object", "target: object needs select.object"),
        ("landing", "target: landing needs select.landing, a landing file"),
    ],
)
def test_a_target_says_what_it_needs(target, message):
    with pytest.raises(ValidationError, match=message):
        SelectConfig(label="throw", target=target)
