from itertools import pairwise, product

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

from besman.exceptions import SegmentationError
from besman.stages.segment.bp_ar_hmm import BpArHmmSampler, infer_shared_states
from besman.stages.segment.bp_ar_hmm_prior import BpArHmmPrior
from besman.stages.segment.hmm_kernel import draw_states, filter_states

WEIGHTS = (
    np.array([[0.99, 0.1], [-0.1, 0.99]]),
    np.array([[0.8, 0.0], [0.0, 0.8]]),
    np.array([[0.95, -0.3], [0.3, 0.95]]),
)
NOISE = (0.05, 0.3, 0.1)


def switch(order, seed, length=60):
    rng = np.random.default_rng(seed)
    states, y = np.repeat(order, length), [np.zeros(2)]
    for k in states[1:]:
        y.append(WEIGHTS[k] @ y[-1] + NOISE[k] * rng.normal(size=2))
    return np.array(y), states


def test_switching_autoregressions_are_recovered_and_shared():
    made = [switch(order, seed) for seed, order in enumerate([(0, 1, 2, 0), (1, 2, 0), (2, 0, 1)])]
    found = infer_shared_states([y for y, _ in made], 120, 0).states
    pairs = {}
    for (_, true), states in zip(made, found, strict=True):
        for k in range(3):
            pairs.setdefault(k, []).append(np.bincount(states[true == k]).argmax())
        changes, borders = np.flatnonzero(np.diff(states)), np.flatnonzero(np.diff(true))
        assert len(changes) == len(borders)
        assert np.abs(changes - borders).max() <= 4
    assert all(len(set(names)) == 1 for names in pairs.values())
    assert len({names[0] for names in pairs.values()}) == 3


def test_the_filter_sums_over_all_sequences():
    rng = np.random.default_rng(0)
    likelihood, weights = rng.normal(size=(5, 4)), rng.gamma(1.0, size=(4, 4))
    active = np.array([0, 2, 3])
    used = weights[np.ix_(active, active)]
    log_transition = np.log(used / used.sum(axis=1, keepdims=True))
    values, sequences = [], list(product(range(3), repeat=5))
    for z in sequences:
        value = -np.log(3) + sum(likelihood[t, active[k]] for t, k in enumerate(z))
        values.append(value + sum(log_transition[a, b] for a, b in pairwise(z)))
    filtered = np.empty((5, 3))
    total = filter_states(likelihood, weights, active, filtered)
    assert total == pytest.approx(logsumexp(values), abs=1e-10)
    draws = [draw_states(weights, active, filtered, rng.random(5)) for _ in range(20000)]
    counted = np.array([(z == 2).mean() for z in np.array(draws).T])
    share = np.exp(np.array(values) - total)
    for t in range(5):
        expected = sum(p for p, z in zip(share, sequences, strict=True) if active[z[t]] == 2)
        assert counted[t] == pytest.approx(expected, abs=0.015)


def test_nothing_is_active_has_no_likelihood():
    empty = np.array([], dtype=np.int64)
    assert filter_states(np.zeros((3, 2)), np.ones((2, 2)), empty, np.empty((3, 0))) == -np.inf


def draw_prior(prior, n, rng):
    """Draw hyper-parameters and sharing from the prior, every recording with something."""
    while True:
        mass, concentration = rng.exponential(prior.mass), rng.exponential(prior.concentration)
        users = []
        for i in range(n):
            users = [[*row, rng.random() < sum(row) / (i + concentration)] for row in users]
            new = rng.poisson(mass * concentration / (i + concentration))
            users += [[False] * i + [True] for _ in range(new)]
        used = np.array(users, dtype=bool).reshape(-1, n).T
        if used.any(axis=1).all() and used.shape[1]:
            return mass, concentration, used


@pytest.mark.slow
def test_the_chain_keeps_the_prior():
    """Geweke: drawing data for the chain's parameters in between leaves the prior as it is."""
    prior = BpArHmmPrior(
        mass=1.5, stickiness=2.0, precision=20.0, degrees_of_freedom=8.0, shortest=3, longest=8
    )
    rng = np.random.default_rng(0)
    n, length = 2, 12
    expected = np.array(
        [
            (used.shape[1], used.sum(), mass, concentration)
            for mass, concentration, used in (draw_prior(prior, n, rng) for _ in range(4000))
        ]
    )
    start = [rng.normal(size=(length, 1)) for _ in range(n)]
    sampler = BpArHmmSampler(start, 1, prior)
    kept = []
    for _ in range(1000):
        series = []
        for z, first in zip(sampler.states, start, strict=True):
            y = [first[0]]
            for k in z:
                a, noise = sampler.parameters[k]
                y.append(a @ y[-1] + np.sqrt(noise[0]) * rng.normal(size=1))
            series.append(np.array(y))
        # Other data under the same prior.
        sampler._y, sampler._h = [y[1:] for y in series], [y[:-1] for y in series]
        sampler._evaluate()
        sampler.sweep()
        kept.append(
            (
                sampler.used.shape[1],
                sampler.used.sum(),
                sampler.mass,
                sampler.concentration,
                sampler.transition,
                sampler.stickiness,
            )
        )
    chain = np.array(kept)
    # Means of 25 batches tell how far the mean of a correlated chain strays.
    error = chain.reshape(25, -1, 6).mean(axis=1).std(axis=0, ddof=1) / np.sqrt(25)
    truth = np.append(expected.mean(axis=0), [prior.transition, prior.stickiness])
    score = (chain.mean(axis=0) - truth) / error
    assert np.abs(score).max() < 4, (chain.mean(axis=0), truth, score)


def test_the_same_seed_gives_the_same_bytes():
    y, _ = switch((0, 1), 3)
    one, other = (infer_shared_states([y], 20, 5) for _ in range(2))
    assert one.states[0].tobytes() == other.states[0].tobytes()
    assert one.log_probability == other.log_probability


def test_the_joint_counts_what_it_says():
    """With one state everywhere the joint is the evidence and the prior of sharing."""
    y, _ = switch((0,), 4)
    sampler = BpArHmmSampler([y], 0)
    evidence = sampler.base.log_evidence(y[:-1], y[1:])
    sharing = stats.poisson.logpmf(1, sampler.mass)
    assert sampler.log_joint() == pytest.approx(evidence + sharing, abs=1e-8)


@pytest.mark.parametrize(
    ("series", "message"),
    [
        ([], "got no recordings"),
        ([np.zeros((1, 2))], r"series 0 must have shape \(T, d\), T >= 2"),
        ([np.ones((9, 2)), np.ones((9, 3))], "series 1 must have shape"),
        ([np.array([[0.0], [np.nan], [1.0]])], "series 0 must be finite; sample 1 is not"),
        ([np.ones((9, 2))], "nothing moves"),
    ],
)
def test_bad_data_are_refused(series, message):
    with pytest.raises(SegmentationError, match=message):
        infer_shared_states(series, 5, 0)


@pytest.mark.parametrize(
    ("prior", "message"),
    [
        (BpArHmmPrior(mass=0.0), "mass: got 0.0; must be positive"),
        (BpArHmmPrior(shortest=9, longest=3), "window: got 9 to 3 samples"),
        (BpArHmmPrior(degrees_of_freedom=0.5), "degrees_of_freedom: got 0.5; must be greater"),
    ],
)
def test_bad_priors_are_refused(prior, message):
    with pytest.raises(SegmentationError, match=message):
        infer_shared_states([switch((0,), 0)[0]], 5, 0, prior)
    with pytest.raises(SegmentationError, match="sweeps: got 0"):
        infer_shared_states([switch((0,), 0)[0]], 0, 0)
