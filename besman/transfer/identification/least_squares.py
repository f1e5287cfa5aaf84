"""Least squares for quantities of which data may tell some and others not.

References
----------
.. [1] G. A. F. Seber, C. J. Wild: Nonlinear regression. Wiley 1989, section 2.1 (covariance of the
   estimates), DOI 10.1002/0471725315.
.. [2] A. Sokal: Monte Carlo methods in statistical mechanics. In: Functional integration, 1997,
   equation 3.18 (as many samples count as are independent), DOI 10.1007/978-1-4899-0319-8_6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Residuals = Callable[[FloatArray], Sequence[FloatArray]]

# Step of the differences, in units.
_STEP = 0.05
# Steps: how many, to which share they are shortened and how often where they lead up; what is too
# little to go on for.
_STEPS, _SHORTER, _SHORTENINGS = 15, 0.4, 6
_FLAT = 1e-5
# Keeps what has no effect where it is, as a share of the greatest slope.
_RIDGE = 1e-7
# What is told worse than this, in units, is not told, unless it has changed by more than so many
# standard deviations.
_VAGUE, _SURE = 1.25, 4.0
# How often what is not told is left out and the rest is sought again.
_ROUNDS = 3
# Errors of one series that are correlated less than this are independent.
_INDEPENDENT = 0.05


@dataclass(frozen=True, eq=False)
class Estimate:
    """What data says of D quantities.

    Attributes
    ----------
    values : array, shape (D,)
        Those that are not told are as they were.
    deviations : array, shape (D,)
        Standard deviations; infinite of what has no effect at all.
    told : bool array, shape (D,)
        Whether the data tells it within its unit.
    """

    values: FloatArray
    deviations: FloatArray
    told: BoolArray


def estimate(
    residuals: Residuals,
    start: FloatArray,
    units: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
    resolution: float,
    jobs: int = 1,
    progress: Callable[[float], None] = lambda share: None,
) -> Estimate:
    """Find the quantities with the least squares of residuals, and how sure they are.

    What the data tells neither within its unit nor to have changed for sure, by itself or apart
    from others, stays as it was, and the rest is found without it. Standard deviations are those
    of the linear model [1]_; of errors that are correlated in time only as many count as are
    independent [2]_.

    Parameters
    ----------
    residuals : callable
        Gives of quantities (D,) one array, shape (T, n), for each of several series.
    start, units : array, shape (D,)
        Where to begin, and which difference matters.
    bounds : two arrays, shape (D,)
    resolution : float
        Of what was measured: no residual is known better.
    jobs : int
        Threads; they change nothing.
    progress : callable
        Called with the share done.

    Returns
    -------
    Estimate
    """
    search = _Search(residuals, units, bounds, jobs, progress)
    told = np.ones(len(start), dtype=bool)
    values, deviations = start.copy(), np.full(len(start), np.inf)
    for _ in range(_ROUNDS):
        values = search.solve(np.where(told, values, start), told)
        series, slopes = search.linearise(values)
        variance = _variance(series, int(told.sum()), resolution)
        moved = np.abs(values - start) / units
        deviations, keep = _sift(slopes, variance, told, moved)
        if keep.all() or not keep[told].any() or np.array_equal(keep, told):
            told = keep
            break
        told = keep
    values = np.where(told, values, start)
    progress(1.0)
    return Estimate(values, deviations * units, told)


class _Search:
    """Solves for some of the quantities, in their units."""

    def __init__(
        self,
        residuals: Residuals,
        units: FloatArray,
        bounds: tuple[FloatArray, FloatArray],
        jobs: int,
        progress: Callable[[float], None],
    ) -> None:
        self._residuals, self._units, self._jobs = residuals, units, jobs
        self._low, self._high = bounds
        self._progress, self._done = progress, 0.0

    def solve(self, first: FloatArray, free: BoolArray) -> FloatArray:
        """Return the quantities (D,) of least squares, those that are not free as at first.

        Gauss-Newton steps, each the solution of a linear problem within the bounds: many quantities
        are at one in the end.
        """
        values = first.copy()
        residual = _flat(self._residuals(values))
        for _ in range(_STEPS if free.any() else 0):
            slopes = self._slopes(values, free)
            step = self._step(values, free, slopes, residual)
            for shorter in range(_SHORTENINGS):
                moved = values + _SHORTER**shorter * step
                there = _flat(self._residuals(moved))
                gained = float(residual @ residual - there @ there)
                if gained > 0:
                    break
            else:
                break
            values, before, residual = moved, float(residual @ residual), there
            if gained <= _FLAT * before:
                break
        return values

    def _step(
        self, values: FloatArray, free: BoolArray, slopes: FloatArray, residual: FloatArray
    ) -> FloatArray:
        """Return the way (D,) to where residuals (N,) are least by their slopes (N, F)."""
        from scipy.optimize import lsq_linear

        unit = self._units[free]
        room = tuple((end - values)[free] / unit for end in (self._low, self._high))
        both = np.column_stack([slopes, residual])
        triangle: FloatArray = np.asarray(np.linalg.qr(both, mode="r"))
        # What has no effect stays.
        ridge = _RIDGE * np.abs(triangle[:, :-1]).max() * np.eye(len(unit))
        system = np.vstack([triangle[:, :-1], ridge])
        wanted = np.concatenate([-triangle[:, -1], np.zeros(len(unit))])
        step = np.zeros(len(values))
        step[free] = unit * lsq_linear(system, wanted, room, method="bvls").x
        return np.clip(values + step, self._low, self._high) - values

    def linearise(self, values: FloatArray) -> tuple[Sequence[FloatArray], FloatArray]:
        """Return the residuals, and their slopes (N, D) a unit of every quantity."""
        every = np.ones(len(values), dtype=bool)
        return self._residuals(values), self._slopes(values, every)

    def _slopes(self, values: FloatArray, free: BoolArray) -> FloatArray:
        """Take differences, (N, F), towards where there is room."""
        base = _flat(self._residuals(values))

        def slope(at: int) -> FloatArray:
            step = _STEP * self._units[at]
            if values[at] + step > self._high[at]:
                step = -step
            moved = values.copy()
            moved[at] += step
            return np.asarray((_flat(self._residuals(moved)) - base) * (self._units[at] / step))

        columns = np.flatnonzero(free)
        with ThreadPoolExecutor(self._jobs) as pool:
            found = np.column_stack(list(pool.map(slope, columns)))
        # Nobody knows how many steps it takes: a part of what is open at each.
        self._done += 0.2 * (1.0 - self._done)
        self._progress(self._done)
        return found


def _flat(series: Sequence[FloatArray]) -> FloatArray:
    """Return all residuals in one row."""
    return np.concatenate([one.ravel() for one in series])


def _variance(series: Sequence[FloatArray], n_free: int, resolution: float) -> float:
    """Return the variance of a residual, times how many of them there are to an independent one."""
    flat = _flat(series)
    variance = float(flat @ flat) / max(len(flat) - n_free, 1) + resolution**2
    lengths = [_correlated(column) for one in series for column in one.T]
    return variance * float(np.mean(lengths))


def _correlated(errors: FloatArray) -> float:
    """Return over how many samples (of T) errors are correlated: the integrated autocorrelation."""
    n = len(errors)
    power = float(errors @ errors)
    if power == 0 or n < 2:
        return 1.0
    spectrum = np.abs(np.fft.rfft(errors, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[:n] / power
    low = np.flatnonzero(correlation < _INDEPENDENT)
    end = int(low[0]) if len(low) else n
    return float(1.0 + 2.0 * correlation[1:end].sum())


def _sift(
    slopes: FloatArray, variance: float, free: BoolArray, moved: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Leave out what is told neither within a unit nor to have changed, the vaguest first.

    Parameters
    ----------
    slopes : array, shape (N, D)
        A unit of every quantity.
    variance : float
        Of a residual.
    free : bool array, shape (D,)
        What was sought.
    moved : array, shape (D,)
        How far it is from where it was, units.

    Returns
    -------
    deviations : array, shape (D,)
        In units, of what is kept beside each other, of each of the others beside what is kept.
        What is left out counts as known within its unit.
    kept : bool array, shape (D,)
    """
    normal = slopes.T @ slopes / variance
    enough = np.maximum(_VAGUE, moved / _SURE)
    kept = free & (np.diag(normal) * enough**2 >= 1.0)
    while kept.any():
        vague = _deviations(normal, kept) / enough
        worst = np.flatnonzero(kept)[np.argmax(vague[kept])]
        if vague[worst] <= 1.0:
            break
        kept[worst] = False
    found = _deviations(normal, kept)
    for at in np.flatnonzero(~kept):
        beside = kept.copy()
        beside[at] = True
        found[at] = _deviations(normal, beside)[at]
    return found, kept


def _deviations(normal: FloatArray, sought: BoolArray) -> FloatArray:
    """Return the standard deviations (D,) of what is sought; infinite of what has no effect.

    All else is as it was only within a unit, which makes what is sought as much vaguer.
    """
    found = np.full(len(sought), np.inf)
    size = np.sqrt(np.diag(normal) + ~sought)
    if not sought.any() or not size[sought].all():
        return found
    # Scaled, or what is told well hides what is told badly.
    scaled = (normal + np.diag(~sought)) / np.outer(size, size)
    inverse = np.linalg.pinv(scaled, rcond=1e-12, hermitian=True)
    vague = np.abs(scaled @ inverse - np.eye(len(size))).max(axis=0) > 1e-3
    spread = np.where(vague, np.inf, np.sqrt(np.maximum(np.diag(inverse), 0.0)) / size)
    found[sought] = spread[sought]
    return found
