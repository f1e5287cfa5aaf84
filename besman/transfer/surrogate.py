"""Estimates of how the real arm's throws differ from the simulated ones."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

# Prior of the shift between simulated and real outcome: what all behaviours share; what is each
# one's own, and over which distance that changes; repeatability of a throw.
_SHARED_M, _OWN_M = 0.4, 0.15
_LENGTH = 3.0
_NOISE_M = 0.02
# Two behaviours that are nearer than this are the same.
_NEAR = 1e-9


class Surrogate(Protocol):
    """What real tries tell about behaviours that were only simulated."""

    def expect(self, behaviours: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return for behaviours (P, B) how far the real outcomes will be moved, and what is open.

        Returns
        -------
        shifts : array, shape (P, 2)
            Real minus simulated outcome on the floor, metres.
        disparities : array, shape (P,)
            By how much the real outcome may be elsewhere than that, metres; the less, the better
            the behaviour transfers.
        """
        ...


class GaussianShift:
    """Gaussian process over behaviours of the shift between simulated and real outcome.

    Transferability is certainty: what is open of a real outcome is the standard deviation of the
    process. Behaviours that nobody tried are expected to do what the simulation says.

    Parameters
    ----------
    behaviours : array, shape (R, B)
        Of the tries, in units in which a difference of one matters.
    shifts : array, shape (R, 2)
        Real minus simulated outcome, metres.
    """

    def __init__(self, behaviours: npt.ArrayLike, shifts: npt.ArrayLike) -> None:
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel

        shared, own = ConstantKernel(_SHARED_M**2, "fixed"), ConstantKernel(_OWN_M**2, "fixed")
        kernel = shared + own * RBF(_LENGTH, "fixed")
        self._process = GaussianProcessRegressor(kernel, alpha=_NOISE_M**2, optimizer=None)
        self._known = len(np.asarray(shifts)) > 0
        if self._known:
            self._process.fit(np.asarray(behaviours), np.asarray(shifts))

    def expect(self, behaviours: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and standard deviation of the process."""
        if not self._known:
            open_m = np.sqrt(2.0) * np.hypot(_SHARED_M, _OWN_M)
            return np.zeros((len(behaviours), 2)), np.full(len(behaviours), open_m)
        means, deviations = self._process.predict(behaviours, return_std=True)
        return np.asarray(means), np.linalg.norm(deviations.reshape(len(behaviours), -1), axis=1)


class InverseDistance:
    """Disparity of behaviours as the average of those tried, weighted by inverse distance.

    It knows no direction: behaviours are not corrected, but those that transfer badly are avoided.

    Parameters
    ----------
    behaviours : array, shape (R, B)
        Of the tries.
    shifts : array, shape (R, 2)
        Real minus simulated outcome, metres; their lengths are the disparities.

    References
    ----------
    .. [1] S. Koos, J.-B. Mouret, S. Doncieux: The transferability approach: crossing the reality
       gap in evolutionary robotics, IEEE Transactions on Evolutionary Computation 17(1), 2013,
       DOI 10.1109/TEVC.2012.2185849 (inverse distance weighting after Shepard).
    """

    def __init__(self, behaviours: npt.ArrayLike, shifts: npt.ArrayLike) -> None:
        self._behaviours = np.asarray(behaviours, dtype=np.float64)
        self._disparities = np.linalg.norm(np.asarray(shifts, dtype=np.float64), axis=-1)

    def expect(self, behaviours: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return no shift, and the weighted average."""
        none = np.zeros((len(behaviours), 2))
        if not len(self._disparities):
            return none, np.zeros(len(behaviours))
        return none, weigh_by_distance(self._behaviours, self._disparities, behaviours)


def weigh_by_distance(known: FloatArray, values: FloatArray, behaviours: FloatArray) -> FloatArray:
    """Average values (R,) at known places (R, B), weighted by inverse squared distance.

    Parameters
    ----------
    known : array, shape (R, B)
    values : array, shape (R,)
    behaviours : array, shape (P, B)
        Where the average is wanted.

    Returns
    -------
    array, shape (P,)
        At a known place its own value.
    """
    distances = np.linalg.norm(behaviours[:, None] - known[None], axis=2)
    weights = 1.0 / np.maximum(distances, _NEAR) ** 2
    return np.asarray((weights * values).sum(axis=1) / weights.sum(axis=1))
