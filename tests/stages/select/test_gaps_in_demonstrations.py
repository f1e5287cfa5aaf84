"""Gaps of back and hand markers inside a demonstration: filled where that can be had."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.exceptions import MappingError
from besman.geometry.frames import quaternion_to_rotation
from besman.records import LabelledRecording, LabelledSegments
from besman.stages.select.body_points import GapLimits
from besman.stages.select.hand_trajectory import map_record
from besman.stages.select.stage import SelectConfig
from besman.work.outcome import Notes
from besman.work.work import Work

RATE = 200.0
BACK = ("back_top", "back_left", "back_right")
HAND = ("hand_top", "hand_left", "hand_right")
BACK_M = [[0.0, 0, 0.08], [0, 0.06, -0.04], [0, -0.06, -0.04]]
HAND_M = [[0.04, 0, 0], [-0.02, 0.03, 0], [-0.02, -0.03, 0]]
BOUNDS = (200, 360)


def path(time):
    """Position (m) and rotation of a hand that swings about two axes."""
    place = np.stack([0.3 * np.sin(2 * time), -0.4 + 0.2 * np.cos(3 * time), 0.1 * time], axis=1)
    turn = Rotation.from_rotvec(np.outer(np.sin(2 * time), [0.3, 0.9, 0.2]))
    return place, turn


def record(hidden=()):
    """A still back and a moving hand; `hidden` are (marker, first row, row after the last)."""
    time = np.arange(0, 4, 1 / RATE)
    place, turn = path(time)
    hand = np.stack([place + turn.apply(point) for point in HAND_M], axis=1)
    back = np.tile(BACK_M, (len(time), 1, 1))
    positions = np.concatenate([back, hand], axis=1) + np.array([1.0, 2.0, 1.3])
    for marker, first, last in hidden:
        positions[first:last, (BACK + HAND).index(marker)] = np.nan
    nothing = np.zeros(positions.shape[:2], dtype=bool)
    return LabelledRecording(time, positions, BACK + HAND, nothing, RATE, "a.tsv", 11)


def hand_of(recording, **options):
    return map_record(recording, BOUNDS, "throw", name="a", cutoff_hz=1000, **options)


def errors(hand):
    """Metres and radians between a demonstration and the true movement."""
    place, turn = path(hand.time + BOUNDS[0] / RATE)
    found = quaternion_to_rotation(hand.poses[:, 3:])
    angle = (Rotation.from_matrix(found).inv() * turn).magnitude()
    return np.linalg.norm(hand.poses[:, :3] - place, axis=1).max(), angle.max()


@pytest.mark.parametrize("marker", HAND)
def test_one_marker_of_a_rigid_cluster_is_found_from_the_other_two(marker):
    hidden = [(marker, 240, 360)]  # 0.6 s, longer than a spline would be trusted
    metres, radians = errors(hand_of(record(hidden)))
    assert metres < 1e-3
    assert radians < 0.03
    # A spline over the same gap would be further off by an order of magnitude.
    spline = hand_of(record(hidden), gaps=GapLimits(spline_s=1.0, rigid_s=0.0))
    assert errors(spline)[0] > 3 * metres


def test_a_short_gap_of_the_whole_hand_is_filled_by_a_spline():
    metres, radians = errors(hand_of(record([(name, 260, 290) for name in HAND])))
    assert metres < 1e-3
    assert radians < 0.02


def test_a_short_gap_of_a_mate_does_not_stand_in_the_way():
    hidden = [("hand_left", 230, 370), ("hand_top", 280, 300)]
    assert errors(hand_of(record(hidden)))[0] < 2e-3


@pytest.mark.parametrize(
    ("hidden", "what"),
    [
        ([("hand_left", 180, 390)], "'hand_left' is not seen in frames 191 to 400"),
        ([(name, 240, 300) for name in HAND], "'hand_top' is not seen in frames 251 to 310"),
        ([("hand_top", 300, 800)], "'hand_top' is not seen in frames 311 to 810"),
        ([(name, 150, 250) for name in BACK], "'back_top' is not seen in frames 161 to 260"),
    ],
)
def test_a_gap_that_is_too_long_names_marker_and_frames(hidden, what):
    message = f"a: {what}; gaps up to longest_gap_s = 0.25 s are filled, and up to longest_rigid"
    with pytest.raises(MappingError, match=message):
        hand_of(record(hidden))


def test_gaps_that_a_demonstration_does_not_need_are_no_matter():
    whole = hand_of(record())
    # The back tells the frame at the start; the hand is looked at during the segment alone.
    hidden = [(name, 260, 800) for name in BACK] + [(name, 0, 195) for name in HAND]
    part = hand_of(record([*hidden, ("hand_left", 365, 800)]))
    np.testing.assert_allclose(part.poses, whole.poses, atol=1e-6)


def test_nothing_is_invented_before_the_first_and_after_the_last_sighting():
    hidden = [("hand_top", 0, 210), ("hand_left", 0, 210)]
    with pytest.raises(MappingError, match="'hand_top' is not seen in frames 11 to 220"):
        hand_of(record(hidden))


def suit(hidden=(), zero=()):
    """The same hand as a sensor suit reports it: a place and an orientation."""
    time = np.arange(0, 4, 1 / RATE)
    place, turn = path(time)
    names = ("t8", "right_upper_arm", "right_fore_arm", "right_hand")
    still = np.tile([[0.0, 0, 0], [0.0, -0.2, 0], [0.2, -0.3, 0]], (len(time), 1, 1))
    positions = np.concatenate([still, place[:, None]], axis=1) + np.array([1.0, 2.0, 1.3])
    orientations = np.zeros((len(time), 4, 4))
    orientations[..., 0] = 1.0
    orientations[:, 3] = turn.as_quat(scalar_first=True)
    for first, last in hidden:
        positions[first:last, 3] = orientations[first:last, 3] = np.nan
    for first, last in zero:
        orientations[first:last, 3] = 0.0
    nothing = np.zeros(positions.shape[:2], dtype=bool)
    return LabelledRecording(time, positions, names, nothing, RATE, "a.mvnx", 0, orientations)


@pytest.mark.parametrize("lost", [{"hidden": [(260, 290)]}, {"zero": [(260, 290)]}])
def test_a_suit_without_an_orientation_for_a_while(lost):
    whole, part = hand_of(suit()), hand_of(suit(**lost))
    np.testing.assert_allclose(part.poses, whole.poses, atol=5e-3)


def test_quaternions_of_zero_throughout():
    with pytest.raises(MappingError, match="a: 'right_hand' is not seen in frames 0 to 799"):
        hand_of(suit(zero=[(0, 800)]))


def test_a_demonstration_with_a_long_gap_is_a_row_with_its_reason():
    bounds = [[0, 100], [200, 360], [400, 500]]
    segments = LabelledSegments(bounds, ("throw",) * 3, np.zeros(3), RATE, "a.tsv", 11)
    recording = record([(name, 230, 300) for name in HAND])
    notes = Notes()
    stage = SelectConfig(label="throw")
    found = stage.run((recording,), (segments,), work=Work(notes=notes))
    assert [one.name for one in found] == ["a.tsv:0", "a.tsv:2"]
    assert [one.name for one in notes.failures] == ["a.tsv:1"]
    assert notes.failures[0].reason.startswith("'hand_top' is not seen in frames 241 to 310; gaps")
    # With longer gaps allowed it is there.
    wider = stage.model_copy(update={"longest_gap_s": 0.4})
    assert len(wider.run((recording,), (segments,))) == 3


def test_a_recording_of_one_still_pose_and_of_nothing():
    still = record()
    positions = np.tile(still.positions[:1], (len(still.time), 1, 1))
    hand = map_record(replace(still, positions=positions), BOUNDS, "throw", name="a")
    np.testing.assert_allclose(hand.poses, hand.poses[:1].repeat(len(hand.time), axis=0), atol=1e-9)
    with pytest.raises(MappingError, match="a: 'back_top' is not seen in frames 11 to 810"):
        hand_of(replace(still, positions=np.full_like(positions, np.nan)))
