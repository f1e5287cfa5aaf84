"""Priors of the BP-AR-HMM, and the data they are scaled by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import SegmentationError
from besman.stages.segment.mniw import Mniw

FloatArray = npt.NDArray[np.float64]


class BpArHmmPrior(NamedTuple):
    """Priors; the values are those of the authors' toolbox.

    The hyper-parameters are drawn as well, from exponential priors with these means.

    Attributes
    ----------
    mass : float
        gamma, expected number of autoregressions of one recording.
    concentration : float
        c; the greater, the less is shared.
    transition : float
        alpha, weight of a transition to another state.
    stickiness : float
        kappa, additional weight of staying.
    precision : float
        K of the autoregressions as a multiple of the identity.
    noise_scale : float
        S of their noise, as a multiple of the covariance of the first differences.
    degrees_of_freedom : float, optional
        nu; the number of dimensions plus 2 if not given.
    shortest, longest : int
        Window from which a new autoregression is proposed, samples.
    """

    mass: float = 5.0
    concentration: float = 1.0
    transition: float = 1.0
    stickiness: float = 25.0
    precision: float = 0.5
    noise_scale: float = 0.5
    degrees_of_freedom: float | None = None
    shortest: int = 15
    longest: int = 100


def check_series(series: Sequence[npt.ArrayLike]) -> list[FloatArray]:
    """Bring all series to arrays (T_i, d), or refuse them."""
    arrays = [np.ascontiguousarray(values, dtype=np.float64) for values in series]
    if not arrays:
        raise SegmentationError("bp_ar_hmm: got no recordings; expected at least 1")
    for index, y in enumerate(arrays):
        if y.ndim != 2 or len(y) < 2 or y.shape[1:] != arrays[0].shape[1:] or y.shape[1] == 0:
            raise SegmentationError(
                f"bp_ar_hmm: series {index} must have shape (T, d), T >= 2 and d the same for "
                f"all, got {y.shape}"
            )
        if not np.isfinite(y).all():
            row = int(np.argmin(np.isfinite(y).all(axis=1)))
            raise SegmentationError(
                f"bp_ar_hmm: series {index} must be finite; sample {row} is not"
            )
    return arrays


def base_distribution(arrays: list[FloatArray], prior: BpArHmmPrior) -> Mniw:
    """Return the prior of an autoregression; first differences of the data scale its noise."""
    for name in ("mass", "concentration", "transition", "stickiness", "precision", "noise_scale"):
        if not getattr(prior, name) > 0.0:
            raise SegmentationError(
                f"bp_ar_hmm: {name}: got {getattr(prior, name)}; must be positive"
            )
    if not 1 <= prior.shortest <= prior.longest:
        raise SegmentationError(
            f"bp_ar_hmm: window: got {prior.shortest} to {prior.longest} samples; must rise from 1"
        )
    d = arrays[0].shape[1]
    nu = d + 2.0 if prior.degrees_of_freedom is None else prior.degrees_of_freedom
    if not nu > d - 1:
        raise SegmentationError(
            f"bp_ar_hmm: degrees_of_freedom: got {nu}; must be greater than {d - 1}"
        )
    steps = np.concatenate([np.diff(y, axis=0) for y in arrays])
    size = float(np.mean(steps**2))
    if size == 0.0:
        raise SegmentationError("bp_ar_hmm: nothing moves in any of the recordings")
    # An axis along which nothing moves must not make the scale singular.
    covariance = steps.T @ steps / len(steps) + 1e-6 * size * np.eye(d)
    identity = np.eye(d)
    return Mniw(np.zeros((d, d)), prior.precision * identity, prior.noise_scale * covariance, nu)
