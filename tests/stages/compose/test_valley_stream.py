"""Valleys while the recording runs, against those of the whole recording."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.exceptions import RecognitionError
from besman.records import LabelledRecording
from besman.stages.compose.borders import find_slow_rows, measure_brisk
from besman.stages.compose.valley_stream import ValleyStream


def stop_and_go(seed, n_samples, rate_hz):
    """Movements and rests of random length, with noise, of one hand."""
    rng = np.random.default_rng(seed)
    pace = np.repeat(
        rng.choice([0.0, 0.0, 0.02, 0.3, 1.0], n_samples),
        rng.integers(1, max(2, round(0.6 * rate_hz)), n_samples),
    )[:n_samples]
    steps = pace[:, np.newaxis] * (0.5 + rng.normal(scale=0.3, size=3))
    path = np.cumsum(steps, axis=0) / rate_hz + rng.normal(scale=1e-4, size=(n_samples, 3))
    return LabelledRecording(
        np.arange(n_samples) / rate_hz,
        path[:, np.newaxis],
        ("hand_top",),
        np.zeros((n_samples, 1), dtype=bool),
        rate_hz,
        "stop_and_go",
    )


@settings(deadline=None, max_examples=200)
@given(
    st.integers(0, 10_000), st.integers(1, 400), st.sampled_from([4.0, 20.0, 60.0, 100.0]),
    st.sampled_from([1.0, 3.0, 8.0]),
)  # fmt: skip
def test_valleys_are_those_of_the_whole_recording(seed, n_samples, rate_hz, factor):
    recording = stop_and_go(seed, n_samples, rate_hz)
    brisk = factor * measure_brisk([recording], "hand_top")
    expected = find_slow_rows(recording, "hand_top", brisk).tolist()
    stream = ValleyStream(rate_hz, brisk)
    for row, position in enumerate(recording.positions[:, 0]):
        stream.add(position)
        known = stream.known_row
        assert known <= row
        assert stream.valleys == expected[: len(stream.valleys)]
        assert all(one in stream.valleys for one in expected if one <= known)
    stream.finish()
    assert stream.valleys == expected


def test_a_long_rest_does_not_hold_up_what_is_known():
    recording = stop_and_go(0, 300, 60.0)
    still = np.broadcast_to(recording.positions[-1, 0], (600, 3))
    stream = ValleyStream(60.0, measure_brisk([recording], "hand_top"))
    for position in (*recording.positions[:, 0], *still):
        stream.add(position)
    assert 900 - stream.known_row < 0.3 * 60


def test_without_a_brisk_speed_that_of_the_recording_counts():
    recording = stop_and_go(1, 300, 60.0)
    given_speed = find_slow_rows(recording, "hand_top", measure_brisk([recording], "hand_top"))
    assert given_speed.tolist() == find_slow_rows(recording, "hand_top").tolist()
    with pytest.raises(RecognitionError, match="no marker 'x'"):
        measure_brisk([recording], "x")
