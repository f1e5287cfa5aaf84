"""Frames of points without names as frames of markers."""

from dataclasses import replace

import numpy as np
import pytest

from besman.config.resources import resource_folder
from besman.following.plans import FollowPlan, learn_names_of
from besman.following.stream_names import StreamNames, needs_names
from besman.io.recordings.formats import read_recording
from besman.live.stream import StreamFormat
from besman.person.marker_set import load_marker_set
from besman.stages.label.model_from_pose import model_from_pose
from besman.stages.label.stage import LabelConfig

SAMPLE = resource_folder("data") / "stick_throw" / "subject1.tsv"


@pytest.mark.parametrize("side", ["right", "left"])
def test_points_are_given_as_they_came_under_the_names_of_the_set(side):
    """Of a left-handed person too, who is named as a mirror shows it."""
    recording = read_recording(SAMPLE)
    marker_set = load_marker_set("right_arm").model_copy(update={"side": side})
    positions = recording.positions[:40] * ([1.0, -1.0, 1.0] if side == "left" else 1.0)
    order = np.random.default_rng(0).permutation(len(recording.names))
    stream = StreamFormat("x", (None,) * len(order), recording.rate_hz)
    names = StreamNames(stream, marker_set, model_from_pose(marker_set))
    for frame in positions[:, order]:
        named, _ = names.take(frame)
    # In the mirror they are those of the sample.
    columns = load_marker_set("right_arm").match(recording.names, recording.source)
    again = marker_set.match(names.format.names, "x")
    for marker in marker_set.required:
        np.testing.assert_array_equal(named[again[marker]], positions[-1, columns[marker]])


def test_names_are_needed_where_required_ones_lack_and_points_have_none():
    marker_set = load_marker_set("right_arm")
    whole = tuple(marker_set.required)
    for given, needed in (
        (whole, False),
        ((*whole, None), False),
        ((*whole[1:], None), True),
        (("a", "b"), False),
    ):
        assert needs_names(StreamFormat("x", given, 100.0), marker_set) == needed


def test_an_earlier_movement_of_a_left_handed_person_tells_the_same_model():
    recording = read_recording(SAMPLE)
    n = round(2 * recording.rate_hz)
    short = replace(recording, time=recording.time[:n], positions=recording.positions[:n])
    right = load_marker_set("right_arm")
    (earlier,) = LabelConfig().run((short,), right)
    learn = learn_names_of(FollowPlan((), earlier=(earlier,)))
    one, other = learn(right), learn(right.model_copy(update={"side": "left"}))
    assert one.markers == other.markers
    np.testing.assert_array_equal(one.distance, other.distance)
    # Without one, the marker set's own pose tells it.
    np.testing.assert_array_equal(
        learn_names_of(FollowPlan(()))(right).distance, model_from_pose(right).distance
    )
