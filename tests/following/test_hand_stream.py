"""The hand of a stream is that of the recording, while it can be believed."""

from dataclasses import replace

import numpy as np
import pytest

from besman.config.resources import resource_folder
from besman.exceptions import LabellingError, MappingError
from besman.following.hand_stream import HandStream
from besman.following.plans import label_by_names
from besman.geometry.frames import quaternion_to_rotation
from besman.io.recordings.formats import read_recording
from besman.person.marker_set import load_marker_set
from besman.stages.select.hand_trajectory import map_record

SAMPLE = resource_folder("data") / "stick_throw" / "subject1.tsv"
BEGIN = 50  # frames of the back, at 100 Hz


@pytest.fixture(scope="module")
def labelled():
    return label_by_names(read_recording(SAMPLE), load_marker_set("right_arm"))


def take_all(labelled, positions):
    stream = HandStream(labelled, "right")
    return [stream.take(frame) for frame in positions]


def test_poses_are_those_of_the_recording(labelled):
    """By record mapping, which knows all of it and filters; the person rests at first."""
    rows = slice(0, 400)
    poses = take_all(labelled, labelled.positions[rows])
    assert [one is None for one in poses] == [True] * BEGIN + [False] * (400 - BEGIN)
    offline = map_record(labelled, (25, 400), "x", name="x", rate_hz=labelled.rate_hz)
    found = np.array(poses[BEGIN:])
    expected = offline.poses[BEGIN - 25 :]
    off = np.linalg.norm(found[:, :3, 3] - expected[:, :3], axis=1)
    assert np.median(off) < 2e-3
    assert off.max() < 0.02
    turn = np.swapaxes(quaternion_to_rotation(expected[:, 3:]), 1, 2) @ found[:, :3, :3]
    angle = np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert np.median(angle) < 0.02


def test_a_hidden_marker_hides_the_hand(labelled):
    positions = labelled.positions[:120].copy()
    positions[80:90, labelled.markers.index("hand_left")] = np.nan
    # Of the back nothing is asked any more.
    positions[60:, labelled.markers.index("back_top")] = np.nan
    poses = take_all(labelled, positions)
    assert [row for row in range(BEGIN, 120) if poses[row] is None] == list(range(80, 90))


def test_markers_that_changed_places_are_no_hand(labelled):
    positions = labelled.positions[:120].copy()
    columns = [labelled.markers.index(name) for name in ("hand_left", "elbow")]
    positions[80:84, columns] = positions[80:84, columns[::-1]]
    poses = take_all(labelled, positions)
    assert [row for row in range(BEGIN, 120) if poses[row] is None] == list(range(80, 84))


@pytest.mark.parametrize(("n_frames", "n_doubted"), [(1, 1), (5, 5), (40, 40)])
def test_a_jump_is_believed_once_the_hand_stays_there(labelled, n_frames, n_doubted):
    positions = np.repeat(labelled.positions[60:61], 180, axis=0)
    positions[80 : 80 + n_frames] += [0.6, 0.0, 0.0]
    doubted = [row for row, pose in enumerate(take_all(labelled, positions)) if pose is None]
    after = [row for row in doubted if row >= BEGIN]
    if n_frames < 20:
        # What comes back to where it was is believed at once.
        assert after == list(range(80, 80 + n_doubted))
    else:
        # A fifth of a second there, and as long back.
        assert after == [*range(80, 100), *range(120, 140)]


def test_the_back_is_waited_for(labelled):
    positions = labelled.positions[:150].copy()
    positions[:60, labelled.markers.index("back_left")] = np.nan
    poses = take_all(labelled, positions)
    assert next(row for row, pose in enumerate(poses) if pose is not None) == 60 + BEGIN


def test_what_cannot_be_a_back_or_a_hand_is_one_line(labelled):
    positions = labelled.positions[:60].copy()
    back = [labelled.markers.index(name) for name in ("back_left", "back_right")]
    positions[:, back[1]] = positions[:, back[0]]
    with pytest.raises(LabellingError, match=r"the first 0\.5 s of the stream: back frame"):
        take_all(labelled, positions)
    kept = [k for k, name in enumerate(labelled.markers) if name != "hand_left"]
    fewer = replace(
        labelled,
        markers=tuple(labelled.markers[k] for k in kept),
        positions=labelled.positions[:, kept],
        filled=labelled.filled[:, kept],
    )
    with pytest.raises(MappingError, match="no marker 'hand_left'"):
        HandStream(fewer, "right")
