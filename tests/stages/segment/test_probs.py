from itertools import pairwise

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

from besman.exceptions import SegmentationError
from besman.stages.segment import probs
from besman.stages.segment.probs import segment_with_primitives

POINTS = np.array([[0.0, 0.0], [1.0, 0.2], [0.3, 1.0], [0.0, 0.0]])


def cycle(seed, n_rounds=3):
    """Three reaches round a triangle, over and over; cuts at the corners and in the middle."""
    rng = np.random.default_rng(seed)
    pieces, corners, cuts, at = [], [0], [0], 0
    for _ in range(n_rounds):
        for start, goal in pairwise(POINTS):
            n = int(rng.integers(18, 24))
            s = np.arange(1, n + 1) / n
            course = 10 * s**3 - 15 * s**4 + 6 * s**5
            pieces.append(start + course[:, None] * (goal - start))
            cuts += [at + n // 2, at + n]
            at += n
            corners.append(at)
    path = np.concatenate(pieces)
    return path + 0.002 * rng.normal(size=path.shape), np.array(cuts), np.array(corners)


def test_repeated_reaches_are_found_among_the_cuts():
    made = [cycle(seed) for seed in range(3)]
    series, cuts = [m[0] for m in made], [m[1] for m in made]
    found = segment_with_primitives(series, cuts, 30, most_primitives=4)
    for (_, _, corners), borders, primitives in zip(
        made, found.borders, found.primitives, strict=True
    ):
        np.testing.assert_array_equal(borders, corners)
        assert len(set(primitives)) == 3
        np.testing.assert_array_equal(primitives[:3], primitives[3:6])


def test_the_evidence_of_a_segment_is_a_gaussian_density():
    y, cuts, _ = cycle(0)
    candidates = probs._fit_candidates([y], [cuts], 30, 4)
    rng = np.random.default_rng(0)
    library = probs._Library(
        np.array([0.4, 0.6]), rng.normal(size=(2, 2, 5)), rng.gamma(2.0, size=(2, 2, 5)), 0.01
    )
    value = probs._evaluate(candidates, library)[0]
    for c in (0, 7):
        a, b = cuts[candidates.first[c]], cuts[candidates.last[c]]
        part = y[a:b] - y[max(a - 1, 0)]
        phi = probs._respond(b - a, 4)
        for k in range(2):
            expected = sum(
                stats.multivariate_normal.logpdf(
                    part[:, axis],
                    phi @ library.means[k, axis],
                    phi * library.variances[k, axis] @ phi.T + 0.01 * np.eye(b - a),
                )
                for axis in range(2)
            )
            assert value[c, k] == pytest.approx(expected, rel=1e-8)


def test_messages_sum_over_all_choices_of_cuts():
    first, last = np.array([(a, b) for b in range(5) for a in range(b)]).T
    evidence = np.random.default_rng(1).normal(size=len(first))
    zeros = np.zeros(len(first))
    candidates = probs._Candidates(zeros.astype(int), first, last, zeros, zeros, zeros, zeros)
    value, share = probs._share_cuts(candidates, [5], evidence)
    table = {(a, b): e for a, b, e in zip(first, last, evidence, strict=True)}
    paths = []
    for mask in range(8):
        cuts = [0, *(k + 1 for k in range(3) if mask >> k & 1), 4]
        paths.append(list(pairwise(cuts)))
    totals = np.array([sum(table[pair] for pair in path) for path in paths])
    assert value == pytest.approx(logsumexp(totals), abs=1e-12)
    for pair, got in zip(table, share, strict=True):
        inside = [total for total, path in zip(totals, paths, strict=True) if pair in path]
        assert got == pytest.approx(np.exp(logsumexp(inside) - value), abs=1e-12)


def test_every_iteration_explains_the_data_better():
    made = [cycle(seed) for seed in range(2)]
    size = 0.4
    candidates = probs._fit_candidates([m[0] / size for m in made], [m[1] for m in made], 30, 5)
    library = probs._start(candidates, 3, np.random.default_rng(0))
    values = []
    for _ in range(15):
        value, library = probs._iterate(candidates, [len(m[1]) for m in made], library)
        values.append(value)
    assert np.diff(values).min() > -1e-6 * abs(values[-1])


@pytest.mark.parametrize(
    ("series", "cuts", "message"),
    [
        ([], [], "got 0 series and cuts of 0"),
        ([np.zeros((1, 2))], [[0, 1]], r"series 0 must have shape \(T, a\)"),
        ([np.array([[0.0], [np.nan]])], [[0, 2]], "series 0 must be finite; sample 1"),
        ([np.eye(3)], [[0, 2]], r"cuts of series 0 must rise from 0 to 3, got \[0, 2\]"),
        ([np.ones((3, 2))], [[0, 3]], "nothing moves"),
    ],
)
def test_bad_data_are_refused(series, cuts, message):
    with pytest.raises(SegmentationError, match=message):
        segment_with_primitives(series, cuts, 10)
