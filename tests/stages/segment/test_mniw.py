import numpy as np
import pytest
from scipy import stats

from besman.stages.segment.mniw import Mniw, log_likelihoods


def make(d, seed=0):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(d, d))
    return Mniw(rng.normal(size=(d, d)), root @ root.T + np.eye(d), 2 * np.eye(d) + 0.3, d + 2.5)


def test_evidence_is_the_one_of_brute_force():
    """One dimension: integrate the likelihood over A and Sigma on a grid."""
    prior = Mniw(np.array([[0.2]]), np.array([[1.5]]), np.array([[0.8]]), 3.0)
    rng = np.random.default_rng(1)
    h, y = rng.normal(size=(5, 1)), rng.normal(size=(5, 1))
    a = np.linspace(-12, 12, 1201)
    log_s = np.linspace(-6, 9, 601)
    s = np.exp(log_s)[:, None]
    value = stats.invgamma.logpdf(s, 1.5, scale=0.4) + log_s[:, None]
    value = value + stats.norm.logpdf(a, 0.2, np.sqrt(s / 1.5))
    for k in range(5):
        value = value + stats.norm.logpdf(y[k, 0], a * h[k, 0], np.sqrt(s))
    brute = np.log(np.exp(value).sum() * (a[1] - a[0]) * (log_s[1] - log_s[0]))
    assert prior.log_evidence(h, y) == pytest.approx(brute, abs=1e-5)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_evidence_chains(d):
    """p(y1, y2) = p(y1) p(y2 | y1), and Bayes' rule holds at any parameters."""
    rng = np.random.default_rng(2)
    prior, h, y = make(d), rng.normal(size=(9, d)), rng.normal(size=(9, d))
    whole = prior.log_evidence(h, y)
    parts = prior.log_evidence(h[:4], y[:4])
    parts += prior.update(h[:4], y[:4]).log_evidence(h[4:], y[4:])
    assert whole == pytest.approx(parts, abs=1e-9)
    at = prior.draw(rng)
    bayes = prior.log_density(*at) + log_likelihoods(y, h, *at).sum()
    bayes -= prior.update(h, y).log_density(*at)
    assert whole == pytest.approx(bayes, abs=1e-8)


def test_density_is_the_one_of_scipy():
    prior, rng = make(2), np.random.default_rng(3)
    a, s = prior.draw(rng)
    expected = stats.invwishart.logpdf(s, prior.nu, prior.scale)
    expected += stats.matrix_normal.logpdf(a, prior.mean, s, np.linalg.inv(prior.precision))
    assert prior.log_density(a, s) == pytest.approx(expected, abs=1e-9)


def test_draws_have_the_moments():
    prior = Mniw(np.array([[1.0, 0.5], [0.0, -1.0]]), np.diag([2.0, 5.0]), np.diag([1.0, 3.0]), 9.0)
    rng = np.random.default_rng(4)
    draws = [prior.draw(rng) for _ in range(20000)]
    a, s = (np.array(part) for part in zip(*draws, strict=True))
    mean = prior.scale / (prior.nu - 3)
    np.testing.assert_allclose(s.mean(axis=0), mean, atol=0.02)
    np.testing.assert_allclose(a.mean(axis=0), prior.mean, atol=0.01)
    np.testing.assert_allclose(a.var(axis=0), np.outer(np.diag(mean), [0.5, 0.2]), rtol=0.1)
