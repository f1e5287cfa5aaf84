"""Exact velocity-based multiple change-point inference (vMCI).

Every segment is modelled on its own: its positions by an autoregression on the sample before, its
speed by one bell and a constant. The weights and the noise are integrated out, and the most
probable segmentation is found by the Viterbi recursion over all starts; no particle filter.

References
----------
L. Gutzeit, *Detection and Recognition of Human Manipulation Building Blocks*, section 4.3 and
appendix A; P. Fearnhead and Z. Liu (2007), doi:10.1111/j.1467-9868.2007.00601.x
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import SegmentationError

FloatArray = npt.NDArray[np.float64]

# Not SciPy's: to load it takes longer than to segment a recording.
_log_gamma = np.vectorize(math.lgamma, otypes=[np.float64])


class VmciModel(NamedTuple):
    """Prior and shape of the models of a segment, for data of unit first differences.

    Where the text of the method and its public implementation differ, the implementation was
    followed if that scored better (internal borders of real recordings, margin 0.3 s).

    Attributes
    ----------
    n_centres : int
        Number of bells to choose from; they stand at k / (n_centres + 1) of the segment.
    bell_width : float
        Width of the bell over the length of the segment. The text has 1/2 (F1 0.654), the
        implementation 1/4 (F1 0.661).
    weight_variance : float
        Prior variance D of the autoregression, in units of the noise. The text has 1 (F1 0.631),
        the implementation 100 (F1 0.661).
    speed_weight_variance : float
        Prior variance of the height of the bell and of the constant, in units of the noise.
    noise_scale : float
        Scale S of the inverse Wishart prior of the noise, as a multiple of the identity: the
        variance of the first differences, which is one after scaling.
    degrees_of_freedom : float, optional
        Its nu, for positions and speeds alike; the number of dimensions plus 2 if not given.
    """

    n_centres: int = 3
    bell_width: float = 0.25
    weight_variance: float = 100.0
    speed_weight_variance: float = 100.0
    noise_scale: float = 1.0
    degrees_of_freedom: float | None = None

    def nu(self, d: int) -> float:
        """Return the degrees of freedom for d dimensions."""
        return d + 2.0 if self.degrees_of_freedom is None else self.degrees_of_freedom


@dataclass(frozen=True)
class ChangePoints:
    """The most probable segmentation.

    Attributes
    ----------
    borders : int array, shape (S + 1,)
        Segment s holds the samples from borders[s] to borders[s + 1] - 1.
    log_probability : float
        Joint log-probability of the borders, their models and the data, eq. (4.8).
    """

    borders: npt.NDArray[np.int64]
    log_probability: float


@dataclass(frozen=True)
class BorderWeights:
    """How probable every border is, all segmentations taken together.

    Attributes
    ----------
    probability : array, shape (T + 1,)
        Posterior probability of a border before sample t; 1 at both ends.
    log_evidence : float
        Log-probability of the data, with the same constant as `ChangePoints.log_probability`.
    """

    probability: FloatArray
    log_evidence: float


def find_change_points(
    positions: npt.ArrayLike,
    speeds: npt.ArrayLike,
    border_probability: float,
    longest: int | None = None,
    model: VmciModel | None = None,
) -> ChangePoints:
    """Find the most probable segmentation of positions and speeds.

    Parameters
    ----------
    positions : array, shape (T, d)
        Positions of one or more sensors, zero mean and first differences of unit size.
    speeds : array, shape (T, s)
        Absolute speed of each of s sensors, first differences of unit size; s may be 0, which
        gives the inference without bells (MCI).
    border_probability : float
        Probability p of a border at a sample: the length of a segment is geometric, eq. (4.6).
    longest : int, optional
        Greatest length of a segment in samples; the distribution of lengths is cut there.
    model : VmciModel, optional
        Prior and shape of the models of a segment.

    Returns
    -------
    ChangePoints
        Borders and their log-probability.

    Raises
    ------
    SegmentationError
        If there are fewer than two samples, shapes do not fit, values are not finite, or a
        parameter is out of its range.

    Notes
    -----
    Two rules come from the public implementation. A segment whose bell would hang down (negative
    weight) is not allowed (F1 0.661, otherwise 0.632). The autoregression of the first sample of a
    segment starts from the sample before the segment, for the first sample of all from itself.
    """
    from besman.stages.segment.vmci_kernel import run_viterbi

    model = model or VmciModel()
    y, v = check_data(positions, speeds)
    factor = tabulate_lengths(len(y), y.shape[1], v.shape[1], border_probability, longest, model)
    best, previous = run_viterbi(*_arrange(y, v, factor, model))
    return ChangePoints(trace_back(previous), float(best[-1]))


def weigh_borders(
    positions: npt.ArrayLike,
    speeds: npt.ArrayLike,
    border_probability: float,
    longest: int | None = None,
    model: VmciModel | None = None,
) -> BorderWeights:
    """Weigh every border: the sum over all segmentations and all bells.

    Parameters and errors are those of `find_change_points`.

    Returns
    -------
    BorderWeights
        Posterior probabilities and the evidence.

    Notes
    -----
    Forward and backward sums of the recursion of eq. (4.7), without simulation: O(T L) segments,
    evaluated twice, and O(T + L) memory.
    """
    from besman.stages.segment.posterior_kernel import run_forward_backward

    model = model or VmciModel()
    y, v = check_data(positions, speeds)
    factor = tabulate_lengths(len(y), y.shape[1], v.shape[1], border_probability, longest, model)
    forward, backward = run_forward_backward(*_arrange(y, v, factor, model))
    evidence = float(forward[-1])
    if not np.isfinite(evidence):
        raise SegmentationError(
            f"no segmentation of {len(y)} samples is possible with segments of at most {longest}"
        )
    return BorderWeights(np.minimum(np.exp(forward + backward - evidence), 1.0), evidence)


def _arrange(
    y: FloatArray, v: FloatArray, factor: FloatArray, model: VmciModel
) -> tuple[FloatArray, FloatArray, FloatArray, int, float, float, float, float, float, float]:
    """Bring data and model to the arguments of the kernels."""
    before = np.concatenate([y[:1], y[:-1]])
    pad = ((factor.size - 1, 0), (0, 0))
    return (
        np.ascontiguousarray(np.pad(np.concatenate([before, y], axis=1), pad).T),
        np.ascontiguousarray(np.pad(v, pad).T),
        factor,
        model.n_centres,
        model.bell_width,
        model.weight_variance,
        model.speed_weight_variance,
        model.noise_scale,
        model.nu(y.shape[1]),
        model.nu(v.shape[1]),
    )


def check_data(positions: npt.ArrayLike, speeds: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Bring the data to contiguous arrays (T, d) and (T, s), or refuse it."""
    y = np.ascontiguousarray(positions, dtype=np.float64)
    v = np.ascontiguousarray(speeds, dtype=np.float64)
    if y.ndim != 2 or v.ndim != 2 or len(y) != len(v) or y.shape[1] == 0:
        raise SegmentationError(
            f"positions and speeds must have shapes (T, d) and (T, s), got {y.shape} and {v.shape}"
        )
    if len(y) < 2:
        raise SegmentationError(f"a segmentation needs at least 2 samples, got {len(y)}")
    for name, values in (("positions", y), ("speeds", v)):
        if not np.all(np.isfinite(values)):
            row = int(np.argmin(np.isfinite(values).all(axis=1)))
            raise SegmentationError(f"{name} must be finite, got {values[row]} in sample {row}")
    return y, v


def tabulate_lengths(
    n_samples: int,
    d_position: int,
    d_speed: int,
    border_probability: float,
    longest: int | None,
    model: VmciModel,
) -> FloatArray:
    """Sum what depends on nothing but the length n of a segment, shape (L + 1,).

    The log-probability of the length and of one of the models, eq. (4.6), and the factors of the
    evidence of positions and speed without data, eq. (A.16) and (A.17). Entry 0 is not used.

    The printed evidence lacks the factor 2^{(n + nu) d / 2} of the Wishart integral; it turns
    (2 pi)^{-n d / 2} into pi^{-n d / 2}.
    """
    if not 0.0 < border_probability < 1.0:
        raise SegmentationError(
            f"border_probability: got {border_probability}; must lie between 0 and 1"
        )
    if longest is not None and longest < 2:
        raise SegmentationError(f"longest segment: got {longest} samples; must be at least 2")
    if model.n_centres < 1:
        raise SegmentationError(f"n_centres: got {model.n_centres}; must be at least 1")
    if not model.noise_scale > 0.0:
        raise SegmentationError(f"noise_scale: got {model.noise_scale}; must be positive")
    least = max(d_position, d_speed) - 1
    if model.degrees_of_freedom is not None and not model.degrees_of_freedom > least:
        raise SegmentationError(
            f"degrees_of_freedom: got {model.degrees_of_freedom}; must be greater than {least}"
        )
    n = np.arange(min(longest or n_samples, n_samples) + 1, dtype=np.float64)
    prior = (n - 1) * np.log1p(-border_probability) + np.log(border_probability)
    if longest is not None:
        prior -= np.log(-np.expm1(longest * np.log1p(-border_probability)))
    position = length_factor(n, d_position, model)
    position -= 0.5 * d_position**2 * np.log(model.weight_variance)
    speed = length_factor(n, d_speed, model) - d_speed * np.log(model.speed_weight_variance)
    log_evidence: FloatArray = prior - np.log(model.n_centres) + position + speed
    return log_evidence


def length_factor(n: FloatArray, d: int, model: VmciModel) -> FloatArray:
    """Log of ``pi^{-n d / 2} |S|^{nu / 2} Gamma_d((n + nu) / 2) / Gamma_d(nu / 2)``."""
    nu = model.nu(d)
    steps = np.arange(d) / 2
    growth = _log_gamma((n[:, np.newaxis] + nu) / 2 - steps) - _log_gamma(nu / 2 - steps)
    scale = 0.5 * nu * d * np.log(model.noise_scale)
    log_factor: FloatArray = scale - 0.5 * n * d * np.log(np.pi) + growth.sum(axis=1)
    return log_factor


def trace_back(previous: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Follow the best starts back from the end.

    Parameters
    ----------
    previous : int array, shape (T + 1,)
        Start of the best segment that ends before each sample.

    Returns
    -------
    int array, shape (S + 1,)
        Borders from 0 to T.
    """
    borders = [len(previous) - 1]
    while borders[-1] > 0:
        borders.append(int(previous[borders[-1]]))
    return np.array(borders[::-1], dtype=np.int64)


def merge_single_samples(borders: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Give segments of one sample to the segment before them, the first to the one after it.

    Parameters
    ----------
    borders : int array, shape (S + 1,)
        Rising sample indices.

    Returns
    -------
    int array, shape (S' + 1,)
        Borders at least two samples apart, unless there is but one sample in all.
    """
    kept = [int(borders[0])]
    for border in borders[1:-1]:
        if border - kept[-1] >= 2:
            kept.append(int(border))
        elif len(kept) > 1:
            # The short segment joins the one before it, which moves that one's end.
            kept[-1] = int(border)
    end = int(borders[-1])
    if len(kept) > 1 and end - kept[-1] < 2:
        kept.pop()
    return np.array([*kept, end], dtype=np.int64)
