from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import multigammaln
from scipy.stats import multivariate_t

from besman.exceptions import SegmentationError
from besman.stages.segment.vmci import VmciModel, find_change_points, merge_single_samples
from besman.stages.segment.vmci_plain import find_change_points_plainly


def make_walk(seed, n_samples, d=3, s=1):
    """Draw a smooth random walk with the speeds of its first s dimensions."""
    rng = np.random.default_rng(seed)
    y = np.cumsum(np.cumsum(rng.normal(size=(n_samples, d)), axis=0) * 0.3, axis=0)
    v = np.abs(np.gradient(y, axis=0))[:, :s] + rng.uniform(0, 0.1, size=(n_samples, s))
    return y - y.mean(axis=0), v


def matrix_t(y, h, variance):
    """Log-density of y with the weights and the noise integrated out, from dense covariances."""
    n, d = y.shape
    nu = d + 2
    rows = np.eye(n) + variance * h @ h.T
    inner = np.eye(d) + y.T @ np.linalg.solve(rows, y)
    weights = variance * h.T @ np.linalg.solve(rows, y)
    value = multigammaln((n + nu) / 2, d) - multigammaln(nu / 2, d) - 0.5 * n * d * np.log(np.pi)
    value -= 0.5 * d * np.linalg.slogdet(rows)[1] + 0.5 * (n + nu) * np.linalg.slogdet(inner)[1]
    return value, weights


def log_evidence(y, v, start, end, model):
    """Log-evidence of one segment, the best over the centres."""
    n = end - start
    before = np.concatenate([y[:1], y[:-1]])[start:end]
    position, _ = matrix_t(y[start:end], before, model.weight_variance)
    if v.shape[1] == 0:
        return position
    options = []
    for k in range(1, model.n_centres + 1):
        radius = model.bell_width * (n - 1) if n > 1 else 1.0
        bell = np.exp(-(((np.arange(n) - k * (n - 1) / (model.n_centres + 1)) / radius) ** 2))
        h = np.stack([bell, np.ones(n)], axis=1)
        value, weights = matrix_t(v[start:end], h, model.speed_weight_variance)
        options.append(value if np.all(weights[0] >= 0) else -np.inf)
    return position + max(options)


def search_all(y, v, p, longest, model):
    """Try every segmentation."""
    n_samples = len(y)
    best, best_borders = -np.inf, None
    cache = {
        (i, j): log_evidence(y, v, i, j, model)
        for i in range(n_samples)
        for j in range(i + 1, n_samples + 1)
    }
    cut = np.log(1 - (1 - p) ** longest) if longest else 0.0
    for count in range(n_samples):
        for inner in combinations(range(1, n_samples), count):
            borders = (0, *inner, n_samples)
            value = -np.log(model.n_centres)
            for i, j in pairwise(borders):
                value += cache[i, j] + (j - i - 1) * np.log(1 - p) + np.log(p) - cut
                value -= np.log(model.n_centres)
                if longest and j - i > longest:
                    value = -np.inf
            if value > best:
                best, best_borders = value, borders
    return best, best_borders


@pytest.mark.parametrize(
    ("n_samples", "d", "s", "longest", "n_centres"),
    [
        (2, 3, 1, None, 3),
        (7, 1, 1, None, 1),
        (9, 3, 1, None, 3),
        (9, 2, 2, 4, 2),
        (11, 3, 1, 5, 3),
        (10, 6, 2, None, 3),
        (10, 3, 0, None, 1),
        (12, 3, 1, None, 3),
    ],
)
def test_no_segmentation_is_more_probable(n_samples, d, s, longest, n_centres):
    for seed in range(3):
        y, v = make_walk(seed, n_samples, d, s)
        model = VmciModel(n_centres=n_centres)
        value, borders = search_all(y, v, 0.3, longest, model)
        for find in (find_change_points, find_change_points_plainly):
            found = find(y, v, 0.3, longest, model)
            assert found.log_probability == pytest.approx(value, abs=1e-8)
            assert tuple(found.borders) == borders


def test_evidence_of_one_dimension_is_a_multivariate_t():
    y, _ = make_walk(4, 6, d=1)
    h = np.concatenate([y[:1], y[:-1]])
    shape = (np.eye(6) + 100.0 * h @ h.T) / 3
    expected = multivariate_t(shape=shape, df=3).logpdf(y[:, 0])
    assert matrix_t(y, h, 100.0)[0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("n_samples", "d", "s", "longest"),
    [(150, 3, 1, None), (700, 3, 1, 60), (130, 9, 3, None), (130, 3, 0, 40)],
)
def test_compiled_and_plain_recursion_agree(n_samples, d, s, longest):
    y, v = make_walk(1, n_samples, d, s)
    compiled = find_change_points(y, v, 0.02, longest)
    plain = find_change_points_plainly(y, v, 0.02, longest)
    assert compiled.log_probability == pytest.approx(plain.log_probability, rel=1e-8)
    np.testing.assert_array_equal(compiled.borders, plain.borders)
    assert longest is None or np.diff(compiled.borders).max() <= longest


def test_long_offsets_do_not_cancel():
    y, v = make_walk(2, 400)
    far = find_change_points(y + 1e6, v, 0.02)
    assert np.isfinite(far.log_probability)
    plain = find_change_points_plainly(y + 1e6, v, 0.02)
    np.testing.assert_array_equal(far.borders, plain.borders)


def test_a_bell_may_not_hang_down():
    # A dip in the speed: with hanging bells one segment would explain it best.
    x = np.linspace(-1, 1, 41)
    v = 10 * (1 - np.exp(-((x / 0.5) ** 2)))[:, np.newaxis] + 1
    y = np.cumsum(v, axis=0) @ np.ones((1, 3))
    assert len(find_change_points(y - y.mean(axis=0), v, 0.02).borders) > 2


@given(
    st.lists(st.integers(1, 5), min_size=1, max_size=12).map(
        lambda steps: np.cumsum([0, *steps]).astype(np.int64)
    )
)
def test_single_samples_are_merged(borders):
    merged = merge_single_samples(borders)
    assert merged[0] == 0
    assert merged[-1] == borders[-1]
    assert set(merged) <= set(borders)
    assert len(merged) == 2 or np.diff(merged).min() >= 2


def test_single_samples_go_to_the_segment_before_them():
    np.testing.assert_array_equal(merge_single_samples(np.array([0, 4, 5, 9])), [0, 5, 9])
    np.testing.assert_array_equal(merge_single_samples(np.array([0, 1, 5, 9])), [0, 5, 9])
    np.testing.assert_array_equal(merge_single_samples(np.array([0, 4, 8, 9])), [0, 4, 9])


def test_data_that_cannot_be_segmented_are_refused():
    y, v = make_walk(0, 10)
    with pytest.raises(SegmentationError, match=r"shapes \(T, d\) and \(T, s\), got"):
        find_change_points(y, v[:-1], 0.1)
    with pytest.raises(SegmentationError, match="needs at least 2 samples, got 1"):
        find_change_points(y[:1], v[:1], 0.1)
    y[3, 1] = np.nan
    with pytest.raises(SegmentationError, match=r"positions must be finite, got .* in sample 3"):
        find_change_points(y, v, 0.1)


@pytest.mark.parametrize("p", [0.0, 1.0, -1.0, np.nan])
def test_border_probability_is_checked(p):
    with pytest.raises(SegmentationError, match=r"border_probability: got .* between 0 and 1"):
        find_change_points(*make_walk(0, 10), p)


def test_lengths_and_centres_are_checked():
    with pytest.raises(SegmentationError, match="longest segment: got 1 samples; must be at least"):
        find_change_points(*make_walk(0, 10), 0.1, 1)
    with pytest.raises(SegmentationError, match="n_centres: got 0"):
        find_change_points(*make_walk(0, 10), 0.1, None, VmciModel(n_centres=0))
