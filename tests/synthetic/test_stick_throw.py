import numpy as np
import pytest

from besman.exceptions import ConfigError
from besman.geometry.frames import back_frame, hand_frame
from besman.synthetic.stick_throw import GRAVITY_MPS2, MARKERS, generate_stick_throws
from besman.synthetic.throw_motion import STICK_AXIS_IN_HAND


@pytest.fixture(scope="module")
def captures():
    return generate_stick_throws(n_subjects=6, n_repetitions=3, rate_hz=100, seed=5)


def marker(capture, name):
    return capture.recording.positions[:, MARKERS.index(name)]


def hand(capture):
    return hand_frame(*(marker(capture, f"hand_{side}") for side in ("top", "left", "right")))


def test_labels_and_borders(captures):
    for capture in captures:
        phases = ("strike_out", "throw", "swing_out", "idle")
        assert capture.segments.labels == ("idle", *phases * 3)
        bounds = capture.segments.bounds
        np.testing.assert_array_equal(bounds[1:, 0], bounds[:-1, 1])
        assert bounds[0, 0] == 0
        assert bounds[-1, 1] == len(capture.recording.time) - 1
        assert (bounds[:, 1] > bounds[:, 0]).all()
        assert capture.recording.time[-1] / 3 < 7


def test_speed_dips_at_the_borders_and_peaks_between(captures):
    for capture in captures:
        _, position = hand(capture)
        speed = np.linalg.norm(np.gradient(position, 0.01, axis=0), axis=1)
        for number, label in enumerate(capture.segments.labels):
            start, end = capture.segments.bounds[number]
            inside = speed[start:end]
            if label == "idle":
                assert inside[5:-5].max() < 0.15
                continue
            edge = max(speed[start], speed[end])
            assert inside.max() > 2 * edge
            if label == "throw":
                assert 2.2 < inside.max() < 3.6
                assert 0.3 < (end - start) / 100 < 0.75
                assert 0.02 < speed[end] < 1.2  # throw and swing out overlap
                assert 0.45 < inside.sum() / 100 < 0.8  # metres


def test_release_and_flight(captures):
    for capture in captures:
        orientation, position = hand(capture)
        stick, time = marker(capture, "stick"), capture.recording.time
        throws = [i for i, label in enumerate(capture.segments.labels) if label == "throw"]
        for throw, segment in zip(capture.throws, throws, strict=True):
            start, end = capture.segments.bounds[segment]
            row = throw.release_frame - capture.recording.first_frame
            assert start < row < end
            speed = np.linalg.norm(np.gradient(position[start:end], 0.01, axis=0), axis=1)
            assert abs(np.argmax(speed) + start - row) <= 2
            before = slice(row - 20, row)
            held = np.linalg.norm(stick[before] - position[before], axis=1)
            assert np.ptp(held) < 0.003
            flight = (time > throw.release_time_s) & (time < throw.touchdown_time_s)
            since = time[flight] - throw.release_time_s
            fit = np.polynomial.polynomial.polyfit(since, stick[flight], 2)
            np.testing.assert_allclose(fit[2], [0, 0, -GRAVITY_MPS2 / 2], atol=0.02)
            np.testing.assert_allclose(fit[0], throw.release_m, atol=0.001)
            velocity = np.gradient(stick[row - 3 : row], 0.01, axis=0)[-1]
            np.testing.assert_allclose(fit[1], velocity, atol=0.3)
            pointing = orientation[row] @ STICK_AXIS_IN_HAND
            assert pointing @ fit[1] / np.linalg.norm(fit[1]) > np.cos(np.deg2rad(30))
            leaving = np.rad2deg(np.arcsin(fit[1, 2] / np.linalg.norm(fit[1])))
            assert 20 < leaving < 45


def test_touchdown(captures):
    for capture in captures:
        stick, time = marker(capture, "stick"), capture.recording.time
        for throw in capture.throws:
            path = np.subtract(throw.touchdown_m, throw.release_m)
            assert 1.4 < np.hypot(*path[:2]) < 2.3
            assert throw.touchdown_m[2] == 0.0
            lying = (time > throw.touchdown_time_s) & (time < throw.touchdown_time_s + 0.3)
            np.testing.assert_allclose(
                stick[lying], np.tile(throw.touchdown_m, (lying.sum(), 1)), atol=0.001
            )
            # Straight ahead, as the person stands.
            start = throw.release_frame - 150
            rotation, _ = back_frame(
                *(marker(capture, f"back_{side}")[start] for side in ("top", "left", "right"))
            )
            ahead = path @ rotation
            assert abs(np.rad2deg(np.arctan2(ahead[1], ahead[0]))) < 25


def test_only_the_stick_is_ever_unseen(captures):
    for capture in captures:
        assert np.isfinite(capture.recording.positions[:, :-1]).all()
        unseen = np.isnan(marker(capture, "stick")[:, 0])
        assert np.diff(unseen.astype(int)).clip(0).sum() == 2  # fetched between three throws
        for number, label in enumerate(capture.segments.labels):
            if label in {"strike_out", "throw"}:
                assert not unseen[slice(*capture.segments.bounds[number])].any()


def test_rigid_clusters_and_noise(captures):
    for capture in captures:
        for first, second in (("hand_top", "hand_left"), ("back_left", "back_right")):
            distance = np.linalg.norm(marker(capture, first) - marker(capture, second), axis=1)
            assert 0.00005 < distance.std() < 0.0005
            assert 0.04 < distance.mean() < 0.15


def test_subjects_differ_and_stand_elsewhere(captures):
    arms = [
        np.linalg.norm(marker(capture, "shoulder") - marker(capture, "elbow"), axis=1).mean()
        for capture in captures
    ]
    places = [marker(capture, "back_top")[0] for capture in captures]
    assert np.ptp(arms) > 0.02
    assert np.std(places, axis=0)[:2].min() > 0.1


def test_subject_does_not_depend_on_the_number_of_subjects():
    one, three = generate_stick_throws(1, 2, 100, 3), generate_stick_throws(3, 2, 100, 3)
    np.testing.assert_array_equal(one[0].recording.positions, three[0].recording.positions)
    assert one[0].throws == three[0].throws


def test_throws_do_not_depend_on_their_number_or_the_rate():
    (short,), (long,) = generate_stick_throws(1, 2, 100), generate_stick_throws(1, 4, 250)
    for first, second in zip(short.throws, long.throws[:2], strict=True):
        assert first.touchdown_m == second.touchdown_m
        assert first.release_time_s == second.release_time_s
    assert long.recording.rate_hz == 250
    assert len(long.recording.time) > 250 * 4 * 4


def test_seed():
    first, second = generate_stick_throws(1, 1, 100, 0), generate_stick_throws(1, 1, 100, 1)
    assert first[0].throws != second[0].throws


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n_subjects": 0}, "stick_throw: subjects: got 0, expected 1 to 1000"),
        ({"n_repetitions": 0}, "stick_throw: throws: got 0"),
        ({"rate_hz": 60}, "stick_throw: rate_hz: got 60, expected 100 to 500"),
        ({"rate_hz": float("nan")}, "stick_throw: rate_hz: got nan"),
        ({"seed": -1}, "stick_throw: seed: got -1"),
    ],
)
def test_numbers_out_of_range(arguments, message):
    with pytest.raises(ConfigError, match=message):
        generate_stick_throws(**arguments)
