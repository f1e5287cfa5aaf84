import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from besman.stages.recognize import splines
from besman.stages.recognize.splines import resample_segments


@settings(max_examples=50, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    cuts=st.lists(st.tuples(st.integers(0, 60), st.integers(2, 40)), min_size=1, max_size=6),
    n_points=st.integers(2, 30),
)
def test_every_segment_has_the_spline_of_its_own_samples(seed, cuts, n_points):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.5, 1.5, 100))
    values = rng.normal(size=(100, 3))
    bounds = np.array([(start, start + length) for start, length in cuts])
    points, step_s = resample_segments(time, values, bounds, n_points)
    for index, (start, end) in enumerate(bounds):
        places = np.linspace(time[start], time[end - 1], n_points)
        expected = CubicSpline(time[start:end], values[start:end])(places)
        np.testing.assert_allclose(points[index], expected, atol=1e-9)
        np.testing.assert_allclose(step_s[index], places[1] - places[0])


def test_no_segments_give_no_points():
    points, step_s = resample_segments(
        np.arange(5.0), np.zeros((5, 2)), np.empty((0, 2), dtype=int), 4
    )
    assert points.shape == (0, 4, 2)
    assert step_s.shape == (0,)


def test_of_many_samples_scipy_solves_to_the_same_last_digit(monkeypatch):
    rng = np.random.default_rng(5)
    bounds = np.array([(0, 40), (30, 33), (50, 52), (60, 99)])
    given = np.cumsum(rng.uniform(0.5, 1.5, 100)), rng.normal(size=(100, 3)), bounds, 20
    own, _ = resample_segments(*given)
    monkeypatch.setattr(splines, "_MANY", 10)
    taken, _ = resample_segments(*given)
    np.testing.assert_array_equal(own, taken)
