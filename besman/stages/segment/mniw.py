"""Autoregressions under their conjugate prior, the matrix-normal inverse Wishart (MNIW).

y = A h + e with e ~ N(0, Sigma), Sigma ~ IW(nu, S), A ~ MN(0, Sigma, K^-1).

References
----------
E. B. Fox, E. B. Sudderth, M. I. Jordan, A. S. Willsky: Bayesian nonparametric inference of
switching dynamic linear models. IEEE Transactions on Signal Processing 59(4), 2011, section III-B,
doi:10.1109/TSP.2010.2102756
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import multigammaln

FloatArray = npt.NDArray[np.float64]


class Mniw(NamedTuple):
    """A matrix-normal inverse Wishart distribution of (A, Sigma).

    Attributes
    ----------
    mean : array, shape (d, d)
        Mean of A.
    precision : array, shape (d, d)
        K, of the columns of A in units of the noise.
    scale : array, shape (d, d)
        S.
    nu : float
        Degrees of freedom, greater than d - 1.
    """

    mean: FloatArray
    precision: FloatArray
    scale: FloatArray
    nu: float

    def update(self, h: FloatArray, y: FloatArray) -> Mniw:
        """Return the posterior given samples y (n, d) and the ones before them, h (n, d)."""
        precision = self.precision + h.T @ h
        weighted = self.mean @ self.precision
        mean = np.asarray(np.linalg.solve(precision, (weighted + y.T @ h).T).T, dtype=np.float64)
        # Residuals keep what a difference of large sums would lose.
        rest, moved = y - h @ mean.T, mean - self.mean
        scale = self.scale + rest.T @ rest + moved @ self.precision @ moved.T
        return Mniw(mean, precision, 0.5 * (scale + scale.T), self.nu + len(y))

    def log_norm(self) -> float:
        """Log of the normalising constant, without the powers of 2 and pi that cancel."""
        d = len(self.scale)
        value = multigammaln(0.5 * self.nu, d) - 0.5 * self.nu * np.linalg.slogdet(self.scale)[1]
        return float(value - 0.5 * d * np.linalg.slogdet(self.precision)[1])

    def log_evidence(self, h: FloatArray, y: FloatArray) -> float:
        """Log-probability of samples y (n, d) after h (n, d), with A and Sigma integrated out."""
        n, d = y.shape
        log_probability: float = (
            self.update(h, y).log_norm() - self.log_norm() - 0.5 * n * d * np.log(np.pi)
        )
        return log_probability

    def draw(self, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        """Draw A (d, d) and Sigma (d, d)."""
        d = len(self.scale)
        # Bartlett: Sigma = L B^-T B^-1 L' with S = L L' and B B' standard Wishart.
        bartlett = np.tril(rng.standard_normal((d, d)), -1)
        bartlett += np.diag(np.sqrt(rng.chisquare(self.nu - np.arange(d))))
        root = np.linalg.cholesky(self.scale) @ np.linalg.inv(bartlett).T
        columns = np.linalg.inv(np.linalg.cholesky(self.precision))
        return self.mean + root @ rng.standard_normal((d, d)) @ columns, root @ root.T

    def log_density(self, weights: FloatArray, noise: FloatArray) -> float:
        """Log-density at A (d, d) and Sigma (d, d)."""
        d = len(noise)
        moved = weights - self.mean
        inverse = np.linalg.inv(noise)
        value = -0.5 * np.trace(inverse @ (self.scale + moved @ self.precision @ moved.T))
        value -= 0.5 * (self.nu + 2 * d + 1) * np.linalg.slogdet(noise)[1]
        constant = 0.5 * self.nu * d * np.log(2.0) + 0.5 * d * d * np.log(2.0 * np.pi)
        return float(value - constant - self.log_norm())


def log_likelihoods(
    y: FloatArray, h: FloatArray, weights: FloatArray, noise: FloatArray
) -> FloatArray:
    """Log-density of every sample under one autoregression, shape (n,)."""
    root = np.linalg.cholesky(noise)
    rest = np.linalg.solve(root, (y - h @ weights.T).T)
    constant = np.log(np.diag(root)).sum() + 0.5 * len(noise) * np.log(2.0 * np.pi)
    log_density: FloatArray = -0.5 * (rest**2).sum(axis=0) - constant
    return log_density
