"""Rest is rest at any noise; movements are found in it as without."""

import numpy as np
import pytest

from besman.records import LabelledRecording
from besman.stages.segment.stage import ValleyVmciConfig
from besman.stages.segment.stillness import least_speed
from besman.stages.segment.valley_vmci import find_movements
from besman.stages.segment.valleys import smooth_speed


def noise(seed, duration_s, rate_hz, deviation, n_markers=1):
    n = round(duration_s * rate_hz)
    rng = np.random.default_rng(seed)
    return np.arange(n) / rate_hz, rng.normal(scale=deviation, size=(n, n_markers, 3)) + 0.5


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 100.0, 240.0, 1000.0])
@pytest.mark.parametrize("deviation", [2e-5, 2e-4, 5e-3])
@pytest.mark.parametrize("n_markers", [1, 2])
def test_noise_is_one_rest(rate_hz, deviation, n_markers):
    for seed in range(5):
        time, paths = noise(seed, 3.0, rate_hz, deviation, n_markers)
        found = find_movements(time, paths)
        np.testing.assert_allclose(found.borders_s, [0.0, 3.0])
        assert found.rests.all()


@pytest.mark.parametrize("rate_hz", [60.0, 100.0, 500.0])
def test_the_speed_of_noise_is_the_one_foreseen(rate_hz):
    time, paths = noise(1, 200.0, rate_hz, 1e-3)
    speed = smooth_speed(time, paths, 0.05)
    foreseen = least_speed(time, paths, 0.05) / 3.5
    assert np.sqrt(np.mean(speed**2)) == pytest.approx(foreseen, rel=0.1)


def reaches(rate_hz=100.0, n=6):
    x = np.linspace(0.0, 1.0, round(0.8 * rate_hz), endpoint=False)
    course = 10 * x**3 - 15 * x**4 + 6 * x**5
    there = np.concatenate([course, np.ones(round(0.7 * rate_hz))])
    way = np.concatenate([k + there for k in range(n)])
    path = np.stack([0.3 * way, 0.0 * way, 1.0 + 0.0 * way], axis=1)
    return np.arange(len(way)) / rate_hz, path[:, np.newaxis]


@pytest.mark.parametrize("deviation", [0.0, 2e-4, 2e-3])
def test_movements_are_found_in_noise(deviation):
    time, paths = reaches()
    found = find_movements(time, paths)
    noisy = paths + np.random.default_rng(0).normal(scale=deviation, size=paths.shape)
    again = find_movements(time, noisy)
    np.testing.assert_array_equal(again.rests, found.rests)
    np.testing.assert_allclose(again.borders_s, found.borders_s, atol=0.1)


def test_too_few_samples_have_no_noise():
    assert least_speed(np.arange(3) / 10, np.zeros((3, 1, 3)), 0.05) == 0.0
    assert least_speed(np.arange(9) / 10, np.ones((9, 1, 3)), 0.0) == 0.0


def segment(paths, names=("hand_top",), rate_hz=100.0):
    recording = LabelledRecording(
        time=np.arange(len(paths)) / rate_hz,
        positions=paths,
        markers=names,
        filled=np.zeros(paths.shape[:2], dtype=bool),
        rate_hz=rate_hz,
        source="still.tsv",
    )
    (segments,) = ValleyVmciConfig().run((recording,))
    return segments.bounds.tolist()


@pytest.mark.parametrize("seed", range(4))
def test_who_stands_and_sways_does_not_move(seed):
    """Filtered noise and swaying have no third differences; a hand that reaches is faster."""
    rng = np.random.default_rng(seed)
    time = np.arange(300) / 100
    sway = 0.004 * np.sin(2 * np.pi * 0.4 * time + rng.uniform(0, 6, size=(3, 1))).T
    assert segment(sway[:, np.newaxis]) == [[0, 300]]
    slow = 0.05 * np.sin(2 * np.pi * 0.4 * time)[:, np.newaxis] * [1.0, 0.0, 0.0]
    assert len(segment(slow[:, np.newaxis])) > 1
