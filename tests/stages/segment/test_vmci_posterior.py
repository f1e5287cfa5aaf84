from itertools import combinations, pairwise

import numpy as np
import pytest
from scipy.special import logsumexp, multigammaln

from besman.exceptions import SegmentationError
from besman.stages.segment.vmci import VmciModel, find_change_points, weigh_borders


def make_walk(seed, n_samples, d=3, s=1):
    rng = np.random.default_rng(seed)
    y = np.cumsum(np.cumsum(rng.normal(size=(n_samples, d)), axis=0) * 0.3, axis=0)
    v = np.abs(np.gradient(y, axis=0))[:, :s] + rng.uniform(0, 0.1, size=(n_samples, s))
    return y - y.mean(axis=0), v


def matrix_t(y, h, variance):
    n, d = y.shape
    nu = d + 2
    rows = np.eye(n) + variance * h @ h.T
    inner = np.eye(d) + y.T @ np.linalg.solve(rows, y)
    value = multigammaln((n + nu) / 2, d) - multigammaln(nu / 2, d) - 0.5 * n * d * np.log(np.pi)
    value -= 0.5 * d * np.linalg.slogdet(rows)[1] + 0.5 * (n + nu) * np.linalg.slogdet(inner)[1]
    return value, variance * h.T @ np.linalg.solve(rows, y)


def log_evidence(y, v, start, end, model):
    """Log-evidence of one segment, summed over its bells."""
    n = end - start
    before = np.concatenate([y[:1], y[:-1]])[start:end]
    value = matrix_t(y[start:end], before, model.weight_variance)[0]
    if v.shape[1] == 0:
        return value
    options = []
    for k in range(1, model.n_centres + 1):
        radius = model.bell_width * (n - 1) if n > 1 else 1.0
        bell = np.exp(-(((np.arange(n) - k * (n - 1) / (model.n_centres + 1)) / radius) ** 2))
        h = np.stack([bell, np.ones(n)], axis=1)
        option, weights = matrix_t(v[start:end], h, model.speed_weight_variance)
        options.append(option if np.all(weights[0] >= 0) else -np.inf)
    return value + logsumexp(options)


def sum_all(y, v, p, longest, model):
    """Sum over every segmentation: evidence and probability of each border."""
    n_samples = len(y)
    cut = np.log(1 - (1 - p) ** longest) if longest else 0.0
    values, members = [], []
    terms = {
        (i, j): log_evidence(y, v, i, j, model)
        + (j - i - 1) * np.log(1 - p)
        + np.log(p)
        - cut
        - np.log(model.n_centres)
        for i in range(n_samples)
        for j in range(i + 1, min(n_samples, i + (longest or n_samples)) + 1)
    }
    for count in range(n_samples):
        for inner in combinations(range(1, n_samples), count):
            borders = (0, *inner, n_samples)
            parts = [terms.get(pair, -np.inf) for pair in pairwise(borders)]
            values.append(sum(parts) - np.log(model.n_centres))
            members.append(np.isin(np.arange(n_samples + 1), borders))
    evidence = logsumexp(values)
    return np.exp(np.array(values) - evidence) @ np.array(members), evidence


@pytest.mark.parametrize(
    ("n_samples", "d", "s", "longest", "n_centres"),
    [
        (2, 3, 1, None, 3),
        (9, 3, 1, None, 3),
        (9, 2, 2, 4, 2),
        (10, 3, 0, None, 1),
        (10, 6, 2, 5, 3),
        (12, 3, 1, None, 3),
    ],
)
def test_weights_are_sums_over_all_segmentations(n_samples, d, s, longest, n_centres):
    y, v = make_walk(n_samples, n_samples, d, s)
    model = VmciModel(n_centres=n_centres)
    probability, evidence = sum_all(y, v, 0.3, longest, model)
    found = weigh_borders(y, v, 0.3, longest, model)
    assert found.log_evidence == pytest.approx(evidence, abs=1e-8)
    np.testing.assert_allclose(found.probability, probability, rtol=0, atol=1e-8)


@pytest.mark.parametrize(("n_samples", "longest"), [(700, None), (1500, 60)])
def test_many_blocks_agree_from_both_ends(n_samples, longest):
    y, v = make_walk(3, n_samples)
    found = weigh_borders(y, v, 0.02, longest)
    assert found.probability[0] == pytest.approx(1.0, abs=1e-8)
    assert found.probability[-1] == 1.0
    assert np.all((found.probability >= 0) & (found.probability <= 1))
    best = find_change_points(y, v, 0.02, longest)
    assert found.log_evidence > best.log_probability
    # On average, the best borders are far more probable than a border anywhere.
    assert found.probability[best.borders].mean() > 5 * found.probability.mean()


def test_arguments_are_checked_as_by_the_search():
    y, v = make_walk(0, 10)
    with pytest.raises(SegmentationError, match="border_probability: got 2"):
        weigh_borders(y, v, 2)
    with pytest.raises(SegmentationError, match=r"shapes \(T, d\) and \(T, s\)"):
        weigh_borders(y, v[:-1], 0.1)
