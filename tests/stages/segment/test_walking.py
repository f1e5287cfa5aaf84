"""A hand that throws while its person walks has the borders of one whose person stands."""

from dataclasses import replace

import numpy as np
import pytest
from places import SAMPLE
from scipy.spatial.transform import Rotation

from besman.io.recordings.formats import read_recording
from besman.person.marker_set import load_marker_set
from besman.stages.label.stage import LabelConfig
from besman.stages.segment.stage import ValleyVmciConfig
from besman.stages.segment.walking import take_from_person

BACK = ("back_top", "back_left", "back_right")


@pytest.fixture(scope="module")
def standing():
    recording = read_recording(SAMPLE / "subject1.tsv")
    (labelled,) = LabelConfig().run((recording,), load_marker_set("right_arm"))
    return labelled


def parts(recording):
    return recording.positions[:, [recording.markers.index("hand_top")]], np.stack(
        [recording.marker(name) for name in BACK], axis=1
    )


def walk(positions, time, speed_m_s, turn_rad_s=0.0):
    """Take all points along a straight line or a circle, turning with it."""
    angle = turn_rad_s * time
    turn = Rotation.from_rotvec(angle[:, np.newaxis] * [0.0, 0.0, 1.0]).as_matrix()
    if turn_rad_s:
        radius = speed_m_s / turn_rad_s
        x, y = radius * np.sin(angle), radius * (1.0 - np.cos(angle))
    else:
        x, y = speed_m_s * time, 0.0 * time
    way = np.stack([x, y, 0.0 * time], axis=1)
    return np.einsum("tij,tkj->tki", turn, positions) + way[:, np.newaxis]


def test_who_stays_is_looked_at_in_the_laboratory(standing):
    hand, back = parts(standing)
    assert take_from_person(hand, back.swapaxes(0, 1), standing.rate_hz) is hand
    blind = np.full_like(back, np.nan)
    assert take_from_person(hand, blind.swapaxes(0, 1), standing.rate_hz) is hand


@pytest.mark.parametrize("speed_m_s", [0.5, -1.2])
def test_who_walks_straight_is_looked_at_from_the_back(standing, speed_m_s):
    hand, back = parts(standing)
    both = walk(np.concatenate((hand, back), axis=1), standing.time, speed_m_s)
    seen = take_from_person(both[:, :1], both[:, 1:].swapaxes(0, 1), standing.rate_hz)
    middle = back.mean(axis=1, keepdims=True)
    np.testing.assert_allclose(seen, hand - middle + middle[0], atol=1e-9)


def test_a_gap_of_the_back_is_bridged(standing):
    hand, back = parts(standing)
    both = walk(np.concatenate((hand, back), axis=1), standing.time, 0.5)
    whole = take_from_person(both[:, :1], both[:, 1:].swapaxes(0, 1), standing.rate_hz)
    both[400:440, 2] = np.nan
    seen = take_from_person(both[:, :1], both[:, 1:].swapaxes(0, 1), standing.rate_hz)
    np.testing.assert_allclose(seen, whole, atol=0.02)


def test_who_walks_in_a_circle_is_looked_at_in_the_frame_of_the_back():
    rng = np.random.default_rng(0)
    time = np.arange(2000) / 100
    back = np.tile([[-0.1, 0.0, 1.4], [-0.1, 0.06, 1.3], [-0.1, -0.06, 1.3]], (2000, 1, 1))
    hand = np.cumsum(rng.normal(scale=0.002, size=(2000, 1, 3)), axis=0) + np.array(
        [0.5, -0.3, 1.0]
    )
    both = walk(np.concatenate((hand, back), axis=1), time, 0.5, 0.4)
    seen = take_from_person(both[:, :1], both[:, 1:].swapaxes(0, 1), 100.0)
    np.testing.assert_allclose(seen, hand, atol=1e-9)


@pytest.mark.parametrize(("speed_m_s", "turn_rad_s"), [(0.5, 0.0), (0.5, 0.1)])
def test_borders_of_a_walking_person_are_those_of_a_standing_one(standing, speed_m_s, turn_rad_s):
    stays = ValleyVmciConfig().run((standing,))[0].bounds[1:, 0]
    moved = walk(standing.positions, standing.time, speed_m_s, turn_rad_s)
    walks = ValleyVmciConfig().run((replace(standing, positions=moved),))[0].bounds[1:, 0]
    hit = [np.abs(walks - border).min() <= 0.1 * standing.rate_hz for border in stays]
    assert np.mean(hit) > 0.9
    assert len(walks) <= 1.1 * len(stays)
