import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.exceptions import MappingError
from besman.geometry.frames import quaternion_to_rotation
from besman.records import LabelledRecording, LabelledSegments
from besman.stages.select.flight import object_touchdown
from besman.stages.select.hand_trajectory import map_record, select_segments
from besman.stages.select.targets import Aim

RATE = 200.0
HAND = {"hand_top": [0.04, 0, 0], "hand_left": [-0.02, 0.03, 0], "hand_right": [-0.02, -0.03, 0]}
BACK = {"back_top": [0.0, 0, 0.08], "back_left": [0, 0.06, -0.04], "back_right": [0, -0.06, -0.04]}
RELEASE, TOUCHDOWN = 1.2, np.array([2.0, 0.3, 0.0])


def hand_path(time):
    u = np.clip((time - 0.8) / 0.6, 0, 1)
    u = 10 * u**3 - 15 * u**4 + 6 * u**5
    return np.array([0.1, -0.4, 0.2]) + np.outer(u, [0.5, 0.1, 0.2]), np.radians(40) * u


NO_TURN = np.eye(3)


def record(lab=NO_TURN, offset=(0.3, -0.2, 1.3), noise=0.0, object_seen=True):
    """A person whose hand pushes forward and turns; the object flies from 1.2 s on."""
    rng = np.random.default_rng(0)
    time = np.arange(0, 2.5, 1 / RATE)
    path, angle = hand_path(time)
    turn = Rotation.from_rotvec(angle[:, None] * [0, 1, 0])
    columns = {name: path + turn.apply(point) for name, point in HAND.items()}
    columns |= {name: np.tile(point, (len(time), 1)) for name, point in BACK.items()}
    held = path + turn.apply([0.05, 0, 0])
    flight = time > RELEASE
    since = time - RELEASE
    fall = np.sqrt(2 * 9.81 * 1.6) / 9.81
    target = np.linalg.inv(lab) @ (TOUCHDOWN - offset)
    start = held[np.searchsorted(time, RELEASE)]
    height = start[2] + offset[2]
    velocity = np.r_[(target - start)[:2] / fall, (9.81 * fall**2 / 2 - height) / fall]
    flying = start + np.outer(since, velocity) - np.outer(since**2, [0, 0, 9.81 / 2])
    columns["stick"] = np.where(flight[:, None], flying, held)
    positions = np.stack(list(columns.values()), axis=1) @ lab.T + offset
    positions += rng.normal(0, noise, positions.shape) if noise else 0.0
    gone = (since > 0.8 * fall) if object_seen else flight
    positions[gone, -1] = np.nan
    filled = np.zeros(positions.shape[:2], dtype=bool)
    return LabelledRecording(time, positions, tuple(columns), filled, RATE, "a.tsv", 11)


BOUNDS = (160, 281)  # 0.8 s to 1.4 s


def test_the_hand_is_found_in_the_back_frame():
    hand = map_record(record(), BOUNDS, "throw", name="a", cutoff_hz=20)
    path, angle = hand_path(hand.time + 0.8)
    assert hand.time[-1] == pytest.approx(0.6)
    assert np.diff(hand.time).max() <= 0.01 + 1e-12
    np.testing.assert_allclose(hand.poses[:, :3], path, atol=1e-3)
    turn = quaternion_to_rotation(hand.poses[:, 3:])
    expected = Rotation.from_rotvec(angle[:, None] * [0, 1, 0]).as_matrix()
    np.testing.assert_allclose(turn, expected, atol=0.01)
    assert np.isnan(hand.target).all()


@pytest.mark.parametrize("yaw", [0.7, 2.0, -3.0])
def test_the_result_does_not_depend_on_where_the_person_stands(yaw):
    lab = Rotation.from_euler("z", yaw).as_matrix()
    one = map_record(record(), BOUNDS, "throw", name="a")
    other = map_record(record(lab, (-1.0, 2.0, 1.3)), BOUNDS, "throw", name="a")
    np.testing.assert_allclose(other.poses, one.poses, atol=1e-9)


def test_noise_is_smoothed():
    clean = map_record(record(), BOUNDS, "throw", name="a")
    noisy = map_record(record(noise=5e-4), BOUNDS, "throw", name="a")
    speed = [np.diff(hand.poses[:, :3], 2, axis=0) for hand in (clean, noisy)]
    assert np.abs(speed[1] - speed[0]).max() < 1e-3
    np.testing.assert_allclose(noisy.poses[:, :3], clean.poses[:, :3], atol=2e-3)


def test_a_high_cutoff_leaves_the_markers_alone():
    raw = map_record(record(), BOUNDS, "throw", name="a", cutoff_hz=1000)
    path, _ = hand_path(raw.time + 0.8)
    np.testing.assert_allclose(raw.poses[:, :3], path, atol=1e-6)


@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_the_flight_is_extrapolated_to_the_floor(noise):
    lab = Rotation.from_euler("z", 0.4).as_matrix()
    recording = record(lab, noise=noise)
    touchdown = object_touchdown(recording, BOUNDS, "stick")
    np.testing.assert_allclose(touchdown, TOUCHDOWN, atol=1e-6 if noise == 0 else 5e-3)
    hand = map_record(recording, BOUNDS, "throw", name="a", aim=Aim(("object",), "stick"))
    back = lab @ hand.target + [0.3, -0.2, 1.3]
    # Noise turns the back frame a little: markers are 12 cm apart, the target is 2 m away.
    np.testing.assert_allclose(back, touchdown, atol=1e-2)


def test_a_flight_that_is_not_seen_gives_no_target():
    hidden = record(object_seen=False)
    assert np.isnan(object_touchdown(hidden, BOUNDS, "stick")).all()
    # A segment long after the flight has nothing to do with it.
    assert np.isnan(object_touchdown(record(), (440, 480), "stick")).all()


def labelled(bounds, labels, rate=100.0):
    return LabelledSegments(bounds, labels, np.zeros(len(labels)), rate, "a.tsv")


def test_selection_by_label_duration_and_merging():
    parts = (
        labelled([[0, 50], [50, 90], [90, 95]], ("throw", "throw", "idle")),
        labelled([[0, 10], [30, 80]], ("throw", "throw")),
    )
    assert [one.segment for one in select_segments(parts, "throw")] == [0, 1, 0, 1]
    merged = select_segments(parts, "throw", merge=True)
    assert [(one.recording, one.start, one.stop) for one in merged] == [
        (0, 0, 90),
        (1, 0, 10),
        (1, 30, 80),
    ]
    long = select_segments(parts, "throw", least_duration_s=0.45, greatest_duration_s=0.5)
    assert [(one.recording, one.start) for one in long] == [(0, 0), (1, 30)]


def test_errors():
    with pytest.raises(MappingError, match="no segment is labelled 'thro'; labels: idle, throw"):
        select_segments((labelled([[0, 5], [5, 9]], ("throw", "idle")),), "thro")
    with pytest.raises(MappingError, match="a: segment 5 to 7: expected at least three rows"):
        map_record(record(), (5, 7), "throw", name="a")
    with pytest.raises(MappingError, match="segment 5 to 9999"):
        map_record(record(), (5, 9999), "throw", name="a")
    with pytest.raises(MappingError, match="no marker 'ball' of a thrown object; markers: hand"):
        object_touchdown(record(), BOUNDS, "ball")
    whole = record()
    less = LabelledRecording(
        whole.time, whole.positions[:, 1:], whole.markers[1:], whole.filled[:, 1:], RATE, "a.tsv"
    )
    with pytest.raises(MappingError, match="a: the recording has no marker 'hand_top'"):
        map_record(less, BOUNDS, "throw", name="a")
