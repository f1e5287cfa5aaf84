from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp

from besman.stages.segment.signals import prepare_signals, resample
from besman.stages.segment.spans import evaluate_spans
from besman.stages.segment.valley_vmci import _find_farthest, _search, _weigh, find_movements
from besman.stages.segment.vmci import VmciModel, tabulate_lengths
from besman.stages.segment.vmci_plain import evaluate_segments


def reach(seed=0, n_moves=5, rate_hz=100.0, pause_s=0.0):
    """Minimum-jerk reaches between random points, with pauses; the time of every border."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(0.2, 0.5, (n_moves + 1, 3)) * rng.choice([-1, 1], 3), axis=0)
    points[1::2, :2] *= -1
    pieces, borders, at = [], [0.0], 0.0
    for index, (start, goal) in enumerate(pairwise(points)):
        n = round(rate_hz * round(rng.uniform(0.8, 1.3), 1))
        s = np.arange(n) / n
        pieces.append(start + (goal - start) * (10 * s**3 - 15 * s**4 + 6 * s**5)[:, np.newaxis])
        at += n / rate_hz
        borders.append(at)
        if pause_s and index < n_moves - 1:
            pieces.append(np.tile(goal, (round(pause_s * rate_hz), 1)))
            at += pause_s
            borders.append(at)
    path = np.concatenate(pieces)
    path = path + rng.normal(scale=2e-4, size=path.shape)
    return np.arange(len(path)) / rate_hz, path[:, np.newaxis], np.array(borders)


@pytest.mark.parametrize("rate_hz", [20.0, 60.0, 100.0, 250.0, 500.0])
@pytest.mark.parametrize("pause_s", [0.0, 0.8])
def test_movements_and_rests_are_found_at_every_rate(rate_hz, pause_s):
    for seed in range(3):
        time, paths, borders = reach(seed, rate_hz=rate_hz, pause_s=pause_s)
        found = find_movements(time, paths)
        assert len(found.borders_s) == len(borders)
        np.testing.assert_allclose(found.borders_s, borders, rtol=0, atol=0.12)
        assert found.rests.tolist() == [
            bool(pause_s) and k % 2 == 1 for k in range(len(borders) - 1)
        ]
        assert np.isfinite(found.log_probability)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 50), st.floats(1e-3, 1e3), st.integers(0, 100))
def test_borders_do_not_depend_on_place_axes_or_unit(seed, unit, turn_seed):
    time, paths, _ = reach(seed, n_moves=3)
    turn = Rotation.random(rng=np.random.default_rng(turn_seed)).as_matrix()
    one = find_movements(time, paths)
    other = find_movements(time, unit * (paths @ turn.T + [3.0, -2.0, 1.0]))
    np.testing.assert_array_equal(one.borders_s, other.borders_s)
    assert np.all(np.diff(one.borders_s) > 0)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10_000), st.integers(2, 300), st.sampled_from([20.0, 60.0, 137.0]))
def test_borders_of_noise_are_sorted_and_inside(seed, n_samples, rate_hz):
    rng = np.random.default_rng(seed)
    paths = np.cumsum(rng.normal(size=(n_samples, 1, 3)), axis=0)
    found = find_movements(np.arange(n_samples) / rate_hz, paths)
    assert found.borders_s[0] == 0
    assert found.borders_s[-1] == pytest.approx(n_samples / rate_hz)
    assert np.all(np.diff(found.borders_s) > 0)
    assert len(found.rests) == len(found.borders_s) - 1
    assert np.all((found.candidate_probability >= 0) & (found.candidate_probability <= 1))


def test_nothing_moves():
    found = find_movements(np.arange(50) / 60, np.full((50, 1, 3), 0.3))
    assert found.borders_s.tolist() == [0.0, pytest.approx(50 / 60)]
    assert np.isnan(found.log_probability)


def test_rests_at_the_ends_are_segments():
    _, paths, borders = reach(3)
    still = np.ones((150, 1, 1))
    longer = np.concatenate([paths[0] * still, paths, paths[-1] * still])
    found = find_movements(np.arange(len(longer)) / 100, longer)
    np.testing.assert_allclose(found.borders_s[1:-1], borders + 1.5, rtol=0, atol=0.12)
    assert found.rests.tolist() == [True] + [False] * (len(borders) - 1) + [True]
    assert found.borders_s[-1] == len(longer) / 100


def test_one_of_two_markers_may_stand_still():
    time, paths, borders = reach(1)
    still = np.concatenate([paths, np.ones_like(paths)], axis=1)
    assert len(find_movements(time, still).borders_s) == len(borders)


def test_spans_have_the_evidence_of_vmci():
    time, paths, _ = reach(2)
    v = prepare_signals(resample(time, paths, 20.0)).speeds
    v = np.concatenate([v, 0.7 * np.roll(v, 1, axis=0) + 0.2], axis=1)
    model = VmciModel(n_centres=4)
    factor = tabulate_lengths(len(v), 0, 2, 0.05, None, model)
    plain = factor + evaluate_segments(np.empty((len(v), 0)), v, len(v), model)
    starts, ends = np.array([0, 11, 30, len(v)]), np.array([0, 9, 30, len(v)])
    spans = evaluate_spans(v, starts, ends, np.full(4, 3), factor, model)
    for i, j in combinations(range(4), 2):
        assert spans[i, j] == pytest.approx(plain[ends[j], ends[j] - starts[i]], abs=1e-7)
    assert np.isfinite(spans).any()
    assert np.all(np.isinf(spans[np.tril_indices(4)]))
    few = evaluate_spans(v, starts, ends, np.full(4, 3), factor[:20], model)
    np.testing.assert_array_equal(few[0, 1], spans[0, 1])
    assert np.isinf(few[0, 3])
    near = evaluate_spans(v, starts, ends, np.array([2, 2, 3, 3]), factor, model)
    asked = np.array([[0, 1, 1, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0]], bool)
    np.testing.assert_array_equal(near, np.where(asked, spans, -np.inf))


@given(st.lists(st.booleans(), max_size=12))
def test_no_way_leads_past_a_sure_valley(sure):
    places = [False, *sure, False]
    for i, farthest in enumerate(_find_farthest(np.array(sure, bool))):
        allowed = [j for j in range(len(places)) if not any(places[i + 1 : j])]
        assert farthest == max(allowed)


def test_search_and_weights_against_all_ways():
    rng = np.random.default_rng(5)
    n = 8
    movement, rest = rng.normal(scale=3, size=(n, n)), np.r_[0.0, rng.normal(size=n - 2), 0.0]
    ways, values = [], []
    for count in range(n - 1):
        for inner in combinations(range(1, n - 1), count):
            way = (0, *inner, n - 1)
            ways.append(way)
            values.append(sum(movement[i, j] + rest[j] for i, j in pairwise(way)))
    path, value = _search(movement, rest)
    assert value == pytest.approx(max(values), abs=1e-12)
    assert tuple(path) == ways[int(np.argmax(values))]
    weights = np.exp(np.array(values) - logsumexp(values))
    expected = [sum(w for way, w in zip(ways, weights, strict=True) if k in way) for k in range(n)]
    np.testing.assert_allclose(_weigh(movement, rest), expected, atol=1e-12)


@pytest.mark.parametrize("n_movements", [3, 12])
def test_no_movement_leads_past_a_deep_valley(n_movements):
    x = np.linspace(0, 1, 61)[:-1]
    reach = 10 * x**3 - 15 * x**4 + 6 * x**5
    way = np.concatenate([k + reach for k in range(n_movements)])
    paths = np.stack([way, 0 * way, 0 * way], axis=1)[:, None]
    found = find_movements(np.arange(len(way)) / 100, paths)
    np.testing.assert_allclose(found.borders_s, 0.6 * np.arange(n_movements + 1), atol=0.03)
