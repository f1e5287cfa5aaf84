import warnings
from dataclasses import replace

import numpy as np
import pytest
from free_throws import label_throws, write_throws

from besman.config.stage import Truth
from besman.exceptions import RecognitionError, RecordingWarning
from besman.stages.recognize.one_throw import OneThrowConfig


@pytest.fixture(scope="module")
def throws(tmp_path_factory):
    folder = tmp_path_factory.mktemp("throws")
    return write_throws(folder, 3), *label_throws(folder)


def test_the_movement_of_the_release_is_the_throw(throws):
    simulated, recordings, segments = throws
    found = OneThrowConfig().run(recordings, segments)
    for throw, named in zip(simulated, found, strict=True):
        (at,) = [row for row, label in enumerate(named.labels) if label == "throw"]
        start, stop = named.bounds[at] / named.rate_hz
        assert start < throw.release_s - 0.2
        assert throw.release_s < stop
    figures = OneThrowConfig().figures(found, Truth())
    assert figures["counts"]["throw"] == 3


def test_a_keypoint_that_jumps_is_no_throw(throws):
    _, recordings, segments = throws
    positions = recordings[0].positions.copy()
    hand = [recordings[0].markers.index(f"hand_{part}") for part in ("top", "left", "right")]
    positions[20, hand] += 2.0
    jumped = replace(recordings[0], positions=positions)
    usual, other = (
        OneThrowConfig().run((one,), segments[:1])[0] for one in (recordings[0], jumped)
    )
    assert usual.labels == other.labels


@pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
def test_the_left_hand_can_be_asked_for(throws):
    _, recordings, segments = throws
    found = OneThrowConfig(arm="left", label="push").run(recordings, segments)
    assert all(one.labels.count("push") == 1 for one in found)


def test_a_hand_that_is_never_seen_throws_nothing(throws):
    _, recordings, segments = throws
    hidden = replace(recordings[0], positions=np.full_like(recordings[0].positions, np.nan))
    with pytest.raises(RecognitionError, match="the right hand is seen to throw in none of"):
        OneThrowConfig().run((hidden,), segments[:1])
    with pytest.warns(
        RecordingWarning, match=r"T0001\.json: the right hand is seen to throw in no"
    ):
        found = OneThrowConfig().run((hidden, recordings[1]), segments[:2])
    assert [one.labels.count("throw") for one in found] == [0, 1]


def test_a_hand_that_throws_less_hard_than_the_other_is_said(throws):
    _, recordings, segments = throws
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        OneThrowConfig().run(recordings, segments)
    said = (
        "the right hand throws harder than the left one in 3 of 3 recordings: --set recognize.arm"
    )
    with pytest.warns(RecordingWarning, match=said):
        OneThrowConfig(arm="left").run(recordings, segments)


def test_an_arm_that_is_not_there_is_named(throws):
    _, recordings, segments = throws
    kept = [k for k, name in enumerate(recordings[0].markers) if not name.startswith("left_")]
    one_arm = replace(
        recordings[0],
        markers=tuple(recordings[0].markers[k] for k in kept),
        positions=recordings[0].positions[:, kept],
        filled=recordings[0].filled[:, kept],
    )
    with pytest.raises(RecognitionError, match="the left arm is not complete"):
        OneThrowConfig(arm="left").run((one_arm,), segments[:1])
