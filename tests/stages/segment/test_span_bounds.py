import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.stages.segment import span_bounds
from besman.stages.segment.span_bounds import MARGIN, SpanBounds
from besman.stages.segment.span_evidence import SpanEvidence
from besman.stages.segment.vmci import VmciModel, tabulate_lengths

N_LEAST = 64


def make_bounds(seed, n_sensors, width=0.25, noise_scale=1.0, leads=None, longest=None):
    """Movement that goes on and on, with starts and ends every few samples."""
    rng = np.random.default_rng(seed)
    n = 600
    hills = 2 + 1.5 * np.sin(np.cumsum(rng.uniform(0.2, 1.2, (n, n_sensors)), axis=0))
    speeds = hills * rng.uniform(0.2, 4) + rng.exponential(rng.uniform(0, 1), (n, n_sensors))
    model = VmciModel(n_centres=5, bell_width=width, noise_scale=noise_scale)
    factor = tabulate_lengths(n, 0, n_sensors, 0.05, longest, model)
    evidence = SpanEvidence(speeds, factor, model)
    ends = np.concatenate([[0], np.sort(rng.choice(np.arange(3, n - 3), 60, False)), [n]])
    starts = np.minimum(ends + rng.integers(0, 2, len(ends)), n)
    if leads is None:
        leads = np.zeros(len(ends)), np.zeros(len(ends))
    return SpanBounds(evidence, N_LEAST, starts, ends, *leads), evidence, starts, ends


@settings(deadline=None, max_examples=25)
@given(
    st.integers(0, 1000),
    st.integers(1, 3),
    st.sampled_from([0.25, 0.4, 1.0]),
    st.sampled_from([0.1, 1.0, 5.0]),
    st.integers(1, 8),
    st.sampled_from([None, 70, 150]),
)
def test_no_span_of_a_block_is_above_its_bound(seed, n_sensors, width, noise_scale, size, longest):
    bounds, evidence, starts, ends = make_bounds(
        seed, n_sensors, width, noise_scale, longest=longest
    )
    rng = np.random.default_rng(seed)
    for _ in range(10):
        i1, k1 = rng.integers(0, len(starts) - size, 2)
        i, k = np.meshgrid(np.arange(i1, i1 + size), np.arange(k1, k1 + size))
        long = ends[k] - starts[i] > N_LEAST
        if not long.any():
            continue
        edges = [np.array([e]) for e in (i1, i1 + size - 1, k1, k1 + size - 1)]
        exact = evidence.evaluate(starts[i[long]], ends[k[long]])
        assert bounds._bound(*edges)[0] >= exact.max()


@pytest.mark.parametrize("gain", [0.3, 0.8])
@pytest.mark.parametrize(("seed", "n_sensors"), [(0, 1), (1, 1), (2, 2)])
def test_what_is_dropped_loses_by_the_margin(seed, n_sensors, gain, monkeypatch):
    monkeypatch.setattr(span_bounds, "LEAF", 4)
    _, evidence, starts, ends = make_bounds(seed, n_sensors)
    # A chain that gains so much a sample on the best long movement from the beginning.
    whole = evidence.evaluate(np.zeros(20, dtype=int), ends[-20:])
    chain = (np.max(whole / ends[-20:]) + gain) * ends
    bounds = SpanBounds(evidence, N_LEAST, starts, ends, -chain, chain)
    number = np.arange(len(starts))
    first = np.zeros(len(starts), dtype=np.int64)
    behind = np.minimum(np.searchsorted(starts, ends - N_LEAST), number)
    blocks = set(zip(*(x.tolist() for x in bounds.find_blocks(first, behind)), strict=True))
    n_long = n_kept = 0
    for k in number:
        asked = np.array([i for i in range(behind[k]) if (k // 4, i // 4) in blocks], dtype=int)
        kept = set(bounds.keep(asked, int(k)).tolist()) if asked.size else set()
        dropped = np.array([i for i in range(behind[k]) if i not in kept], dtype=int)
        exact = evidence.evaluate(starts[dropped], np.full(len(dropped), ends[k]))
        assert np.all(exact < chain[k] - chain[dropped] - MARGIN)
        n_long, n_kept = n_long + behind[k], n_kept + len(kept)
    assert 0 < n_kept < n_long


def test_without_any_chain_nothing_is_dropped():
    none = np.full(62, -np.inf)
    bounds, _, _, ends = make_bounds(1, 1, leads=(none, none))
    assert bounds.keep(np.arange(20), 50).tolist() == list(range(20))
    blocks = bounds.find_blocks(np.zeros(62, dtype=int), np.searchsorted(ends, ends - N_LEAST))
    assert [x.tolist() for x in blocks] == [[0], [0]]


def test_bells_that_are_all_but_constant_bound_nothing():
    bounds, _, _, _ = make_bounds(1, 1, width=30.0)
    assert bounds._bound(*np.zeros((3, 1), dtype=int), np.array([60]))[0] == np.inf
