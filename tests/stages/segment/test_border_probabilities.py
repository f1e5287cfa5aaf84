from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_valleys import evaluate_all, search, weigh
from scipy.special import logsumexp

from besman.stages.segment import border_probabilities, long_spans, span_bounds, spans
from besman.stages.segment.border_probabilities import Ways
from besman.stages.segment.span_evidence import SpanEvidence
from besman.stages.segment.spans import Spans
from besman.stages.segment.vmci import VmciModel, tabulate_lengths


class Table:
    """Movements of given evidence; the long ones are known to within a width."""

    def __init__(self, movement, rest, near, width=0.0):
        self.movement, self.rest, self.near, self.width = movement, rest, near, width
        self.asked = []

    def short(self, k):
        return self.movement[self.near[k] : k, k]

    def long(self, k):
        starts = np.arange(self.near[k])
        off = self.width * np.random.default_rng(k).uniform(size=len(starts))
        low = self.movement[starts, k] - off
        return starts, low, low + self.width, low + 0.5 * self.width

    def evaluate(self, i, k):
        self.asked.append((i, k))
        return float(self.movement[i, k])


def random_table(seed, n=8, width=0.0):
    rng = np.random.default_rng(seed)
    movement, rest = rng.normal(scale=3, size=(n, n)), np.r_[0.0, rng.normal(size=n - 2), 0.0]
    movement[rng.uniform(size=(n, n)) < 0.1] = -np.inf
    movement[np.arange(n - 1), np.arange(1, n)] = rng.normal(size=n - 1)
    near = np.minimum(np.sort(rng.integers(0, n, n)), np.maximum(np.arange(n) - 1, 0))
    return Table(movement, rest, near, width)


@pytest.mark.parametrize("seed", range(10))
def test_best_way_and_weights_against_all_ways(seed):
    table = random_table(seed)
    n = len(table.rest)
    all_ways = [
        (0, *inner, n - 1)
        for count in range(n - 1)
        for inner in combinations(range(1, n - 1), count)
    ]
    values = [sum(table.movement[i, k] + table.rest[k] for i, k in pairwise(w)) for w in all_ways]
    found = Ways(table)
    assert found.log_probability == pytest.approx(max(values), abs=1e-12)
    assert tuple(found.best) == all_ways[int(np.argmax(values))]
    weights = np.exp(np.array(values) - logsumexp(values))
    expected = [
        sum(w for way, w in zip(all_ways, weights, strict=True) if k in way) for k in range(n)
    ]
    np.testing.assert_allclose(found.weigh(), expected, atol=1e-12)
    assert tuple(search(table.movement, table.rest)[0]) == tuple(found.best)
    np.testing.assert_allclose(weigh(table.movement, table.rest), expected, atol=1e-12)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.integers(2, 30), st.sampled_from([0.01, 0.3, 3.0]))
def test_bounds_do_not_change_the_best_way(seed, n, width):
    table = random_table(seed, n, width)
    way, value = search(table.movement, table.rest)
    found = Ways(table)
    assert found.best.tolist() == way
    assert found.log_probability == pytest.approx(value, abs=1e-9)
    off = np.abs(found.weigh() - weigh(table.movement, table.rest))
    assert off.max() <= np.expm1(2 * n * width)


def test_little_is_evaluated_where_bounds_are_close():
    table = random_table(3, 30, 0.01)
    found = Ways(table)
    assert len(set(table.asked)) < 2 * len(found.best)


def test_where_no_way_leads_nothing_is_probable():
    movement = np.full((4, 4), -np.inf)
    movement[0, 1] = 1.0
    found = Ways(Table(movement, np.zeros(4), np.array([0, 0, 1, 2])))
    assert found.best.tolist() == [0, 3]
    assert found.log_probability == -np.inf
    assert found.weigh().tolist() == [0.0] * 4


def short_limits(monkeypatch, kept=2**21):
    """Let movements be long from 64 samples on, and blocks small."""
    monkeypatch.setattr(long_spans, "_LEAST_WIDTH", 16)
    for module in (long_spans, spans):
        monkeypatch.setattr(module, "REACH", 32)
    for module in (span_bounds, spans):
        monkeypatch.setattr(module, "LEAF", 8)
    monkeypatch.setattr(border_probabilities, "_MOST_KEPT", kept)


def random_valleys(seed, n_samples, n_sensors, steady, longest=None, depth=None):
    """Speeds with valleys, some of them sure; what `Spans` takes."""
    rng = np.random.default_rng(seed)
    gap = rng.uniform(3, 15)
    ends = np.cumsum(rng.uniform(0.6, 1.4, n_samples) * gap).astype(int)
    ends = ends[ends < n_samples - 2]
    starts = ends + rng.integers(0, 3, len(ends)) * (rng.uniform(size=len(ends)) < 0.2)
    ends, starts = np.r_[0, ends, n_samples], np.r_[0, starts, n_samples]
    phase = np.interp(np.arange(n_samples), ends, np.pi * np.arange(len(ends)))
    if depth is None:
        depth = 0.5 if steady else rng.uniform(0.3, 0.9)
    level = (
        1
        if steady
        else np.interp(phase, np.pi * np.arange(len(ends)), rng.uniform(0.5, 2, len(ends)))
    )
    hills = level * (1 - depth + depth * np.sin(phase) ** 2)
    speeds = rng.uniform(1, 8, n_sensors) * hills[:, np.newaxis]
    speeds = speeds + rng.exponential(rng.uniform(0.05, 1), (n_samples, n_sensors))
    model = VmciModel(n_centres=9)
    factor = tabulate_lengths(n_samples, 0, n_sensors, 0.05, longest, model)
    sure = rng.uniform(size=len(ends)) < (0.0 if steady else 0.03)
    rest = np.where(starts > ends, rng.normal(size=len(ends)), 0.0)
    return SpanEvidence(speeds, factor, model), starts, ends, rest, sure


@pytest.mark.parametrize(
    ("n_sensors", "steady", "kept", "longest"),
    [
        (1, False, 2**21, None),
        (1, True, 2**21, None),
        (1, True, 50, None),
        (1, False, 2**21, 200),
        (2, False, 2**21, None),
        (3, True, 50, None),
    ],
)
def test_spans_give_what_all_pairs_give(monkeypatch, n_sensors, steady, kept, longest):
    short_limits(monkeypatch, kept)
    for seed in range(2):
        arguments = random_valleys(seed, 400 if n_sensors == 1 else 250, n_sensors, steady, longest)
        evidence, starts, ends, rest, sure = arguments
        all_spans = Spans(*arguments, {})
        assert np.any(all_spans.far < all_spans.near)
        movement = evaluate_all(evidence, starts, ends, sure)
        found = Ways(all_spans)
        way, value = search(movement, rest)
        assert found.best.tolist() == way
        assert found.log_probability == pytest.approx(value, abs=1e-6)
        np.testing.assert_allclose(found.weigh(), weigh(movement, rest), rtol=0, atol=1e-4)


def test_movements_from_and_to_rest_are_given(monkeypatch):
    short_limits(monkeypatch)
    evidence, starts, ends, rest, sure = random_valleys(1, 200, 1, False)
    given = {1: -3.0, len(ends) - 1: 4.0}
    some = Spans(evidence, starts, ends, rest, sure, given)
    movement = evaluate_all(evidence, starts, ends, sure, given)
    assert some.evaluate(0, 1) == -3.0
    assert some.evaluate(len(ends) - 2, len(ends) - 1) == 4.0
    assert Ways(some).log_probability == pytest.approx(search(movement, rest)[1], abs=1e-6)


def test_a_great_many_movements_cannot_win(monkeypatch):
    short_limits(monkeypatch)
    evidence, starts, ends, rest, _ = random_valleys(5, 6000, 1, False, depth=0.95)
    some = Spans(evidence, starts, ends, rest, np.zeros(len(ends), bool), {})
    n_long = sum(len(some.long(k)[0]) for k in range(1, len(ends)))
    assert n_long < 0.1 * np.sum(some.near - some.far)
