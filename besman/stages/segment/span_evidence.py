"""The evidence of chosen segments; see `besman.stages.segment.valley_vmci`."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.stages.segment.vmci import VmciModel

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Values that are laid side by side at once; bounds the memory.
_VALUES_AT_ONCE = 2**20


class SpanEvidence(NamedTuple):
    """What the evidence of the speed between two samples depends on.

    Attributes
    ----------
    speeds : array, shape (T, s)
        Scaled.
    factor : array, shape (L + 1,)
        See `besman.stages.segment.vmci.tabulate_lengths`; a span of more than L samples is none.
    model : VmciModel
        Prior and shape of the models of a segment.
    """

    speeds: FloatArray
    factor: FloatArray
    model: VmciModel

    @property
    def nu(self) -> float:
        """Degrees of freedom of the noise."""
        return self.model.nu(self.speeds.shape[1])

    @property
    def centres(self) -> FloatArray:
        """Where the bells stand, shape (C,), shares of the span."""
        n_centres = self.model.n_centres
        return np.arange(1, n_centres + 1) / (n_centres + 1)

    def evaluate(self, starts: IntArray, ends: IntArray) -> FloatArray:
        """Evaluate the log-evidence of spans, eq. (A.17): the best bell; none may hang down.

        Spans of one length share their bells, and the products with them are one of matrices.

        Parameters
        ----------
        starts, ends : int array, shape (K,)
            Span k holds the samples starts[k] to ends[k] - 1.

        Returns
        -------
        array, shape (K,)
            -inf for a span shorter than two samples, or too long, or with bells that hang.
        """
        lengths = ends - starts
        found = np.full(len(starts), -np.inf)
        usable = np.flatnonzero((lengths >= 2) & (lengths < len(self.factor)))
        usable = usable[np.argsort(lengths[usable], kind="stable")]
        edges = np.flatnonzero(np.diff(lengths[usable], prepend=-1, append=-1))
        for low, high in pairwise(edges):
            n = int(lengths[usable[low]])
            at_once = max(1, _VALUES_AT_ONCE // (n * self.speeds.shape[1]))
            for first in range(low, high, at_once):
                chosen = usable[first : min(first + at_once, high)]
                found[chosen] = self._evaluate_alike(starts[chosen], n)
        return found

    def _evaluate_alike(self, starts: IntArray, n: int) -> FloatArray:
        """Evaluate spans of n samples."""
        model, n_sensors = self.model, self.speeds.shape[1]
        place = np.arange(n)
        basis = np.ones((n, model.n_centres + 1))
        offset = (place[:, np.newaxis] - self.centres * (n - 1)) / (model.bell_width * (n - 1))
        basis[:, :-1] = np.exp(-(offset**2))
        total, squares = basis[:, :-1].sum(axis=0), (basis[:, :-1] ** 2).sum(axis=0)
        a = squares + 1.0 / model.speed_weight_variance
        e = n + 1.0 / model.speed_weight_variance
        determinant = a * e - total**2
        windows = self.speeds[starts[:, np.newaxis] + place]
        sensors = windows.transpose(0, 2, 1)
        products = sensors @ basis
        p, q = products[..., :-1], products[..., -1:]
        height, level = e * p - total * q, a * q - total * p
        explained = height[:, :, np.newaxis] * p[:, np.newaxis]
        explained += level[:, :, np.newaxis] * q[:, np.newaxis]
        scatter = sensors @ windows + model.noise_scale * np.eye(n_sensors)
        noise = scatter[..., np.newaxis] - explained / determinant
        value = -0.5 * n_sensors * np.log(determinant)
        value = value - 0.5 * (n + self.nu) * log_determinants(np.moveaxis(noise, -1, 1))
        value = np.where((height < 0.0).any(axis=1), -np.inf, value)
        best: FloatArray = self.factor[n] + value.max(axis=1)
        return best


def log_determinants(matrices: FloatArray) -> FloatArray:
    """Log-determinants of small positive definite matrices, shape (..., s, s)."""
    if matrices.shape[-1] == 1:
        return np.log(matrices[..., 0, 0])
    logs: FloatArray = np.linalg.slogdet(matrices)[1]
    return logs
