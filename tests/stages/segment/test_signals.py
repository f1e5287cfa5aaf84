import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from besman.stages.segment.signals import measure_scaling, pool_scalings, prepare_signals, resample


def make_path(seed=0, n_samples=80, m=1):
    return np.cumsum(np.random.default_rng(seed).normal(size=(n_samples, m, 3)), axis=0)


def test_the_same_rate_changes_nothing():
    time = 4.0 + np.arange(50) / 60
    values = make_path(1, 50)
    np.testing.assert_allclose(resample(time, values, 60.0), values, atol=1e-12)


def test_a_straight_line_stays_one_inside():
    time = np.arange(601) / 60
    out = resample(time, 3.0 + 2.0 * time, 20.0)
    assert out.shape == (201,)
    np.testing.assert_allclose(out[1:-1], 3.0 + 2.0 * np.arange(1, 200) / 20, atol=1e-9)


@pytest.mark.parametrize("rate_hz", [20.0, 30.0, 17.3])
def test_every_sample_is_the_mean_over_its_period(rate_hz):
    time = np.arange(1000) / 100
    values = np.sin(2 * np.pi * 0.5 * time)
    out = resample(time, values, rate_hz)
    expected = np.sin(2 * np.pi * 0.5 * np.arange(len(out)) / rate_hz)
    np.testing.assert_allclose(out[1:-1], expected[1:-1], atol=0.01)


def test_what_is_too_fast_does_not_fold_back():
    time = np.arange(2000) / 200
    out = resample(time, np.sin(2 * np.pi * 20.0 * time), 20.0)
    assert np.abs(out[1:-1]).max() < 0.02


def test_signals_have_unit_steps_and_central_speeds():
    path = make_path(2)
    signals = prepare_signals(path)
    assert np.mean(np.diff(signals.positions, axis=0) ** 2) == pytest.approx(1.0)
    assert np.mean(np.diff(signals.speeds, axis=0) ** 2) == pytest.approx(1.0)
    np.testing.assert_allclose(signals.positions.mean(axis=0), 0, atol=1e-12)
    raw = np.linalg.norm(path[2:, 0] - path[:-2, 0], axis=1)
    assert np.corrcoef(raw, signals.speeds[1:-1, 0])[0, 1] == pytest.approx(1.0)


@given(st.integers(0, 1000), st.floats(1e-3, 1e3), st.floats(-100, 100))
def test_unit_place_and_axes_do_not_matter(seed, unit, shift):
    path = make_path(seed, 30, 2)
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    one = prepare_signals(path)
    other = prepare_signals(unit * (path @ turn.T) + shift)
    np.testing.assert_allclose(other.speeds, one.speeds, rtol=1e-6, atol=1e-8)
    turned = one.positions.reshape(30, 2, 3) @ turn.T
    np.testing.assert_allclose(other.positions.reshape(30, 2, 3), turned, rtol=1e-6, atol=1e-7)


def test_what_stands_still_has_no_signal():
    still = np.full((20, 1, 3), 0.7)
    signals = prepare_signals(still)
    assert not signals.moves
    assert not signals.positions.any()
    both = prepare_signals(np.concatenate([still, make_path(0, 20)], axis=1))
    assert both.moves
    assert np.isfinite(both.positions).all()
    assert not both.speeds[:, 0].any()


def test_steady_movement_has_finite_speeds():
    path = np.arange(20.0)[:, np.newaxis, np.newaxis] * [1.0, 0.0, 0.0]
    signals = prepare_signals(path)
    assert signals.moves
    np.testing.assert_allclose(signals.speeds, 1.0)


def test_pooled_scaling():
    rng = np.random.default_rng(0)
    paths = [np.cumsum(rng.normal(size=(400, 2, 3)), axis=0) for _ in range(2)]
    one, two = (measure_scaling(path) for path in paths)
    both = pool_scalings([one, two])
    np.testing.assert_allclose(both.step, np.sqrt((one.step**2 + two.step**2) / 2))
    still = measure_scaling(np.zeros((5, 2, 3)))
    np.testing.assert_allclose(pool_scalings([one, still]).change, one.change)
    assert np.isinf(pool_scalings([still, still]).step).all()
