import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from besman.exceptions import RecognitionError
from besman.records import LabelledRecording
from besman.stages.recognize.features import FEATURE_NAMES, count_channels, extract_features

MARKERS = ("hand_top", "elbow", "shoulder")
OBJECTS = ("box_back", "box_left")
NAMES = (
    "back_top",
    "back_left",
    "back_right",
    "shoulder",
    "elbow",
    "hand_top",
    "hand_left",
    "hand_right",
    "box_back",
    "box_left",
)
REST = np.array(
    [
        [0.0, 0.0, 1.4],
        [0.0, 0.1, 1.2],
        [0.0, -0.1, 1.2],
        [0.1, -0.2, 1.4],
        [0.1, -0.2, 1.1],
        [0.45, -0.2, 1.1],
        [0.38, -0.16, 1.1],
        [0.38, -0.24, 1.1],
        [0.6, 0.0, 1.0],
        [0.6, 0.1, 1.0],
    ]
)


def record(positions, rate_hz=50.0):
    time = np.arange(len(positions)) / rate_hz
    filled = np.zeros(positions.shape[:2], dtype=bool)
    return LabelledRecording(time, positions, NAMES, filled, rate_hz, "a.tsv", 100)


def swing(n_samples=60, speed=1.2):
    """An arm whose forearm turns about the elbow at a steady rate, upper arm down."""
    angle = speed * np.arange(n_samples) / 50.0
    positions = np.repeat(REST[np.newaxis], n_samples, axis=0)
    turn = Rotation.from_euler("y", -angle[:, np.newaxis]).as_matrix()
    hand = [NAMES.index(f"hand_{side}") for side in ("top", "left", "right")]
    positions[:, hand] = REST[4] + np.einsum("tij,mj->tmi", turn, REST[hand] - REST[4])
    return positions


def one(feature, positions=None, bounds=(0, 60), n_points=25):
    recording = record(swing() if positions is None else positions)
    return extract_features(recording, [bounds], [feature], MARKERS, OBJECTS, n_points)[0]


def test_positions_are_in_the_back_frame():
    out = one("positions")
    assert out.shape == (25, 9)
    np.testing.assert_allclose(out[0], (REST[[5, 4, 3]] - REST[:3].mean(axis=0)).ravel())
    np.testing.assert_allclose(out[:, 3:6], np.tile(out[0, 3:6], (25, 1)))


def test_speeds_are_per_second():
    out = one("speeds")
    np.testing.assert_allclose(out[:, 0], 1.2 * 0.35, rtol=1e-3)
    np.testing.assert_allclose(out[:, 1:], 0, atol=1e-12)


def test_hand_orientation_is_two_axes():
    out = one("hand_orientation")
    angle = np.linspace(0, 1.2 * 59 / 50, 25)
    zero = np.zeros(25)
    expected = np.stack(
        [np.cos(angle), zero, np.sin(angle), -np.sin(angle), zero, np.cos(angle)], axis=1
    )
    np.testing.assert_allclose(out, expected, atol=1e-5)


def test_joint_angles_and_rates():
    angle = np.linspace(0, 1.2 * 59 / 50, 25)
    np.testing.assert_allclose(one("elbow_angle")[:, 0], np.pi / 2 - angle[:25], atol=2e-6)
    np.testing.assert_allclose(one("elbow_rate")[:, 0], -1.2, rtol=1e-3)
    np.testing.assert_allclose(one("shoulder_angle"), 0, atol=1e-7)
    np.testing.assert_allclose(one("shoulder_rate"), 0, atol=1e-6)


def test_shoulder_angle_is_that_of_a_raised_arm():
    positions = swing()
    positions[:, NAMES.index("elbow")] = positions[:, NAMES.index("shoulder")] + [0.3, 0, 0]
    np.testing.assert_allclose(one("shoulder_angle", positions), np.pi / 2)


def test_object_distance_and_speed():
    positions = swing()
    box = [NAMES.index(name) for name in OBJECTS]
    positions[:, box, 0] += 0.5 * np.arange(60)[:, np.newaxis] / 50
    distance = one("object_distance", positions)
    np.testing.assert_allclose(distance[0], np.linalg.norm([0.15, 0.25, -0.1]))
    np.testing.assert_allclose(one("object_speed", positions), 0.5, rtol=1e-9)


@settings(deadline=None, max_examples=30)
@given(st.floats(-np.pi, np.pi), st.floats(-5, 5), st.floats(-5, 5))
def test_where_the_person_stands_does_not_matter(heading, x, y):
    turn = Rotation.from_euler("z", heading).as_matrix()
    moved = swing() @ turn.T + [x, y, 0.3]
    here, there = (
        extract_features(record(p), [(5, 50)], FEATURE_NAMES, MARKERS, OBJECTS)
        for p in (swing(), moved)
    )
    np.testing.assert_allclose(there, here, atol=1e-6)


def test_the_back_frame_is_the_one_of_the_first_sample():
    positions = swing()
    positions += 0.01 * np.arange(60)[:, np.newaxis, np.newaxis]
    still, later = one("positions", positions, (0, 60)), one("positions", positions, (20, 60))
    np.testing.assert_allclose(later[0, 3:], still[0, 3:], atol=1e-12)
    assert later[-1, 3] - later[0, 3] == pytest.approx(0.39)


@pytest.mark.parametrize("feature", FEATURE_NAMES)
def test_channels_are_counted(feature):
    assert one(feature).shape[1] == count_channels([feature], MARKERS)[0]


def test_duration_does_not_change_the_number_of_points():
    assert one("positions", bounds=(0, 2), n_points=7).shape == (7, 9)
    assert one("positions", bounds=(0, 60), n_points=7).shape == (7, 9)


def test_no_segments_give_no_features():
    empty = np.empty((0, 2), dtype=np.int64)
    out = extract_features(record(swing()), empty, ["positions"], MARKERS)
    assert out.shape == (0, 25, 9)


def test_gaps_matter_only_inside_a_segment_and_for_the_markers_needed():
    positions = swing()
    positions[40:, NAMES.index("elbow")] = np.nan
    positions[:, NAMES.index("box_left")] = np.nan
    assert np.isfinite(one("positions", positions, (0, 40))).all()
    with pytest.raises(RecognitionError, match="marker 'elbow' was not seen in frame 140; expect"):
        one("positions", positions, (30, 50))
    with pytest.raises(RecognitionError, match="marker 'box_left' was not seen in frame 100"):
        one("object_speed", positions, (0, 40))


def test_what_cannot_be_computed_is_refused():
    recording = record(swing())
    with pytest.raises(RecognitionError, match="no feature 'position'; did you mean 'positions'"):
        extract_features(recording, [(0, 9)], ["position"], MARKERS)
    with pytest.raises(RecognitionError, match=r"a.tsv: no marker 'wrist'; allowed"):
        extract_features(recording, [(0, 9)], ["positions"], ("wrist",))
    with pytest.raises(RecognitionError, match="need markers on an object, got none"):
        extract_features(recording, [(0, 9)], ["object_speed"], MARKERS)


@pytest.mark.parametrize("bounds", [(5, 6), (-1, 9), (50, 61), (9, 5)])
def test_segments_outside_the_recording_are_refused(bounds):
    with pytest.raises(RecognitionError, match=r"got segment \[.*expected at least 2 samples"):
        one("positions", bounds=bounds)


def test_markers_without_a_direction_are_refused():
    positions = swing()
    positions[:, NAMES.index("back_left")] = positions[:, NAMES.index("back_right")]
    with pytest.raises(RecognitionError, match=r"a.tsv: row 3: back frame: expected back_left"):
        one("positions", positions, (3, 20))
    positions = swing()
    positions[:, NAMES.index("hand_left")] = positions[:, NAMES.index("hand_right")]
    with pytest.raises(RecognitionError, match=r"a.tsv: hand frame at sample 0"):
        one("hand_orientation", positions)
