import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.stages.segment.long_spans import REACH, BellSums, LongSpans, longest_exact
from besman.stages.segment.span_evidence import SpanEvidence
from besman.stages.segment.vmci import VmciModel, tabulate_lengths


def moving_on(seed, n_samples, n_sensors, model=None):
    """Speeds that rise and fall without rest, and their evidence."""
    rng = np.random.default_rng(seed)
    phase = np.cumsum(rng.uniform(0.2, 0.8, (n_samples, n_sensors)), axis=0)
    level = 1 + 0.5 * np.sin(np.linspace(0, rng.uniform(0, 30), n_samples))[:, np.newaxis]
    speeds = rng.uniform(0.5, 10) * level * (1 + 0.4 * np.sin(phase))
    speeds += rng.exponential(0.3, speeds.shape)
    model = model or VmciModel(n_centres=9)
    factor = tabulate_lengths(n_samples, 0, n_sensors, 0.05, None, model)
    return SpanEvidence(speeds, factor, model)


@settings(deadline=None, max_examples=15)
@given(
    st.integers(0, 1000),
    st.integers(1, 3),
    st.sampled_from([0.15, 0.25, 0.5]),
    st.integers(1, 9),
    st.floats(0.3, 300.0),
    st.integers(0, REACH),
)
def test_the_evidence_lies_between_its_bounds(seed, n_sensors, width, n_centres, variance, after):
    model = VmciModel(n_centres, width, speed_weight_variance=variance, noise_scale=0.5)
    evidence = moving_on(seed, 1500, n_sensors, model)
    end = 1500 - after
    rng = np.random.default_rng(seed)
    starts = np.sort(rng.integers(0, end - longest_exact(width), 20))
    exact = evidence.evaluate(starts, np.full(20, end))
    low, high, likely = LongSpans(evidence).bound(starts, end, 1500, int(starts[0]))
    assert np.all(low <= exact)
    assert np.all(exact <= high)
    assert np.all((low <= likely) & (likely <= high))


def test_bounds_of_an_hour_are_close():
    evidence = moving_on(0, 72_000, 1)
    starts = np.array([0, 30_000, 71_000, 71_700])
    exact = evidence.evaluate(starts, np.full(4, 71_990))
    low, high, likely = LongSpans(evidence).bound(starts, 71_990, 72_000, 0)
    assert np.all((low <= exact) & (exact <= high))
    assert np.all(high - low < 1.0)
    np.testing.assert_allclose(likely, exact, rtol=0, atol=0.01)


def test_running_sums_serve_ends_in_any_order():
    evidence = moving_on(3, 4000, 2)
    long = LongSpans(evidence)
    for end, first in ((2000, 500), (2100, 100), (1950, 900), (2090, 0), (3900, 3000), (1200, 700)):
        starts = np.arange(first, end - longest_exact(0.25), 97)
        found = long.bound(starts, end, min(end + REACH, 4000), first)
        again = LongSpans(evidence).bound(starts, end, end, 0)
        np.testing.assert_allclose(found, again, rtol=0, atol=1e-3)


def test_a_bell_that_hangs_is_none():
    s = np.linspace(-1, 1, 400)
    speeds = (5 + 4 * s**2)[:, np.newaxis]
    model = VmciModel(n_centres=9)
    evidence = SpanEvidence(speeds, tabulate_lengths(400, 0, 1, 0.05, None, model), model)
    low, high, likely = LongSpans(evidence).bound(np.array([0]), 400, 400, 0)
    exact = evidence.evaluate(np.array([0]), np.array([400]))
    assert exact == pytest.approx(high, abs=0.1)
    middle = VmciModel(n_centres=1)
    evidence = SpanEvidence(speeds, tabulate_lengths(400, 0, 1, 0.05, None, middle), middle)
    assert evidence.evaluate(np.array([0]), np.array([400]))[0] == -np.inf
    low, high, likely = LongSpans(evidence).bound(np.array([0]), 400, 400, 0)
    assert low[0] == high[0] == likely[0] == -np.inf


@pytest.mark.parametrize("width", [0.1, 0.25, 0.6])
def test_sums_of_bells(width):
    centres = np.array([0.1, 0.5, 0.8])
    n = np.array([longest_exact(width), 1000, 20_001])
    sums, squares = BellSums(centres, width).over(n)
    for k, count in enumerate(n):
        place = np.arange(count)[:, np.newaxis] / (count - 1)
        bells = np.exp(-(((place - centres) / width) ** 2))
        np.testing.assert_allclose(sums[k], bells.sum(axis=0), rtol=1e-11)
        np.testing.assert_allclose(squares[k], (bells**2).sum(axis=0), rtol=1e-11)
