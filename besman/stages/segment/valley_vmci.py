r"""vMCI over the valleys of the speed, with rests: the default segmentation.

Exact vMCI says well how many movements there are, but its borders lie where the two models fit
about equally well, a sixth of a second from where a person sees them, and a pause ends up inside a
movement. Here the speed says where a border may be, and the evidence of vMCI which of these places
are borders.

1. The positions are low-passed and their speed is taken on a grid of 100 Hz, whatever the rate of
   the recording (`besman.stages.segment.valleys`). The valleys of the speed with which the path
   gets on, lower where it turns (`besman.stages.segment.straightness`), are candidates. One whose
   floor is slower than a share of both peaks beside it, for long enough, holds a rest from sample
   a_k to b_k; any other is a turning point, a_k = b_k.
2. A movement runs from the end of one valley to the beginning of a later one. Its log-evidence is
   that of the speed v in vMCI, eq. (A.17), at 20 Hz: the best of nine bells and a constant, with
   their weights and the noise integrated out:

   .. math::

       M_{jk} = \max_c \log p(v_{b_j : a_k} | c) + \log g(a_k - b_j)

3. A rest is a model of its own: no speed but for noise, whose scale S_0 is a tenth of that of a
   movement, squared. With n samples of s speeds,

   .. math::

       R_k = \log g(n) + \log \frac{\Gamma_s((n + \nu) / 2)}{\pi^{n s / 2} \Gamma_s(\nu / 2)}
             + \frac{\nu}{2} \log |S_0| - \frac{n + \nu}{2} \log |S_0 + v' v|

   Speeds that noise alone would have are rest as well (`besman.stages.segment.stillness`).

4. No movement leads past a valley deeper than 0.3 of the lower peak beside it: the evidence alone
   takes many short, alike movements for one (simulated step patterns: F1 0.69 and 1.00).
5. The most probable segmentation maximises the sum over its movements and rests, found by dynamic
   programming over valleys, B_k = R_k + max_j (B_j + M_jk). Forward and backward sums of the same
   terms give every valley its posterior probability.

Not all pairs of valleys are evaluated, which would be cubic in the length of a recording. No
movement leads past a sure valley (4.), which leaves few. Those of up to 256 samples, 13 s, are
evaluated; of the longer ones, where somebody moves on without slowing down, a bound says which
cannot win (`besman.stages.segment.span_bounds`), and the others are bounded from both sides at a
cost that does not grow with their length (`besman.stages.segment.long_spans`) and evaluated where
these bounds leave open which way is best (`besman.stages.segment.border_probabilities`). The
borders are those of all pairs, the probabilities theirs to within 1e-4. Time and memory grow with
the length of the recording, but for movement without a sure valley that is alike all through, as of
a machine that stirs: any stretch of that may be one movement, and time grows with the square of its
length.

The length of a segment is geometric, g(n) = p (1 - p)^{n - 1}, with one border per second expected:
neither the recording's length nor its rate enters. All constants are shares of the recording's own
speed or times of human movement; none belongs to a data set.

Unlike vMCI, the evidence leaves out the positions. Their autoregression has no constant, so that a
border costs the more the farther the hand is from the centre of the recording: of minimum-jerk
reaches that lead away from where they began it found one border in eight (F1 0.13; speed alone:
0.98), while real recordings gain next to nothing from it (F1 0.972 and 0.963). Nine bells in place
of three let the peak lie where it may (simulated throws: F1 0.97 and 0.94, before rests at the ends
of a recording were looked for; 1.00 since).

References
----------
L. Gutzeit, *Detection and Recognition of Human Manipulation Building Blocks*, section 4.3 and
appendix A; its outlook (chapter 8) proposes to combine vMCI with local minima.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.stages.segment.border_probabilities import Ways
from besman.stages.segment.signals import prepare_signals, resample
from besman.stages.segment.span_evidence import SpanEvidence
from besman.stages.segment.spans import Spans
from besman.stages.segment.stillness import least_speed
from besman.stages.segment.straightness import speed_ahead
from besman.stages.segment.valleys import (
    GRID_HZ,
    Valley,
    ValleyShape,
    find_sure,
    find_valleys,
    path_speed,
    smooth_path,
)
from besman.stages.segment.vmci import VmciModel, length_factor, tabulate_lengths

FloatArray = npt.NDArray[np.float64]

# The evidence takes samples as independent: they are no closer than the smoothing allows.
EVIDENCE_HZ = 20.0

# Borders per second that are expected before any data are seen.
_BORDERS_PER_S = 1.0

# Where the peak of a movement's speed may lie: at every tenth of its duration.
MODEL = VmciModel(n_centres=9)

# Noise of a rest over that of a movement; a half and twice of it give the same borders.
_REST_NOISE = 0.1


@dataclass(frozen=True)
class MovementsAndRests:
    """The most probable segmentation into movements and rests.

    Attributes
    ----------
    borders_s : array, shape (S + 1,)
        Seconds from the first sample; first 0, last the end.
    rests : bool array, shape (S,)
        True for a rest.
    log_probability : float
        Joint log-probability of borders and data at `EVIDENCE_HZ`; NaN if nothing moves.
    candidates_s : array, shape (C, 2)
        Beginning and end of every valley, seconds.
    candidate_probability : array, shape (C,)
        Posterior probability of each valley being a border.
    """

    borders_s: FloatArray
    rests: npt.NDArray[np.bool_]
    log_probability: float
    candidates_s: FloatArray
    candidate_probability: FloatArray


def find_movements(
    time: npt.ArrayLike,
    paths: npt.ArrayLike,
    longest_s: float | None = None,
    model: VmciModel | None = None,
    shape: ValleyShape | None = None,
) -> MovementsAndRests:
    """Segment the paths of one or more markers into movements and rests.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds, rising in equal steps.
    paths : array, shape (T, m, 3)
        Positions of m markers, metres; of another unit that of ``shape.least``.
    longest_s : float, optional
        Greatest duration of a movement, seconds.
    model : VmciModel, optional
        Prior and shape of the models of a movement; of nine bells if not given.
    shape : ValleyShape, optional
        What counts as a valley and as a rest.

    Returns
    -------
    MovementsAndRests
        Borders lie on a grid of 100 Hz.

    Raises
    ------
    SegmentationError
        If a parameter of the model is out of its range.
    """
    t = np.asarray(time, dtype=np.float64)
    x = np.asarray(paths, dtype=np.float64)
    shape = shape or ValleyShape()
    step = (t[-1] - t[0]) / (len(t) - 1)
    rate_hz = min(EVIDENCE_HZ, 1 / step)
    samples = resample(t, x, rate_hz)
    whole = np.array([0.0, len(t) * step])
    still = MovementsAndRests(whole, np.ones(1, bool), np.nan, np.empty((0, 2)), np.empty(0))
    if len(samples) < 2:
        return still
    signals = prepare_signals(samples)
    if not signals.moves:
        return still
    path = smooth_path(t, x, shape.smoothing_s)
    speed = path_speed(path)
    shape = shape._replace(least=max(shape.least, least_speed(t, x, shape.smoothing_s)))
    # Where the bell reaches beyond the recording, noise is faster.
    edge = min(round(2 * shape.smoothing_s * GRID_HZ), (len(speed) - 1) // 2)
    if speed[edge : len(speed) - edge].max() < shape.least:
        return still
    ahead = speed_ahead(path, speed, GRID_HZ)
    longest = None if longest_s is None else max(2, round(longest_s * rate_hz))
    # A marker that stands still says nothing.
    speeds = signals.speeds[:, signals.speeds.any(axis=0)]
    found = find_ways(speed, ahead, speeds, rate_hz, shape, longest, model or MODEL)
    valleys, ways = found.valleys, found.ways
    borders, rests = found.borders()
    return MovementsAndRests(
        np.array([*(np.array(borders) / GRID_HZ), whole[-1]]),
        np.array(rests),
        ways.log_probability,
        np.array(valleys, dtype=np.float64).reshape(-1, 2) / GRID_HZ,
        ways.weigh()[1:-1],
    )


class WaysThrough(NamedTuple):
    """Valleys, and the ways that lead through them.

    Attributes
    ----------
    valleys : list of Valley
    sure : bool array, shape (V,)
        Those that are borders in any case.
    ways : Ways
    n_grid : int
        Samples of the speed.
    """

    valleys: list[Valley]
    sure: npt.NDArray[np.bool_]
    ways: Ways
    n_grid: int

    def borders(self) -> tuple[list[int], list[bool]]:
        """Return where segments begin on the most probable way, and which of them are rests."""
        borders, rests = [0], []
        best = self.ways.best
        for first, last in (self.valleys[k - 1] for k in best[1:-1]):
            if first > 0:
                borders.append(first)
                rests.append(False)
            if last > first:
                borders.append(last)
                rests.append(True)
        if len(best) > 2 and self.valleys[best[-2] - 1].last == self.n_grid:
            borders.pop()
        else:
            rests.append(False)
        return borders, rests


def find_ways(
    speed: FloatArray,
    ahead: FloatArray,
    speeds: FloatArray,
    rate_hz: float,
    shape: ValleyShape,
    longest: int | None,
    model: VmciModel,
    typical: float | None = None,
    first: int = 0,
) -> WaysThrough:
    """Find the valleys of a stretch, and the ways through them.

    Parameters
    ----------
    speed, ahead : array, shape (G,)
        Speed, and that with which the path gets on, on a grid of `GRID_HZ`, m/s.
    speeds : array, shape (T, s)
        Scaled speeds for the evidence, at `rate_hz`.
    rate_hz : float
    shape : ValleyShape
        What counts as a valley and as a rest.
    longest : int, optional
        Greatest length of a movement, samples of `speeds`.
    model : VmciModel
    typical : float, optional
        See `besman.stages.segment.valleys.find_valleys`.
    first : int
        Where the stretch begins on the grid of the recording; `speeds` begin at the last of their
        samples before that.
    """
    valleys = find_valleys(speed, shape, ahead, typical)
    sure = find_sure(ahead, valleys, shape.sure)
    spans = _find_spans(speeds, valleys, sure, len(speed), rate_hz, longest, model, first)
    return WaysThrough(valleys, sure, Ways(spans), len(speed))


def _find_spans(
    speeds: FloatArray,
    valleys: list[Valley],
    sure: npt.NDArray[np.bool_],
    n_grid: int,
    rate_hz: float,
    longest: int | None,
    model: VmciModel,
    first: int,
) -> Spans:
    """Find the movements and evaluate the rests; the two ends count as valleys."""
    n_samples, s = speeds.shape
    p = min(0.5, _BORDERS_PER_S / rate_hz)
    at = np.array(valleys, dtype=np.float64).reshape(-1, 2) + first
    places = np.round(at / GRID_HZ * rate_hz) - first_sample(first, rate_hz)
    places = np.clip(places, 0, n_samples).astype(np.int64)
    # A recording may begin or end at rest.
    given = {}
    if valleys and valleys[0].first == 0:
        given[1] = 0.0
    if valleys and valleys[-1].last == n_grid:
        places[-1, 1] = n_samples
        given[len(valleys) + 1] = 0.0
    starts = np.concatenate([[0], places[:, 1], [n_samples]])
    ends = np.concatenate([[0], places[:, 0], [n_samples]])
    still = model._replace(noise_scale=model.noise_scale * _REST_NOISE**2)
    rest = np.array(
        [_evaluate_rest(speeds[a:b], p, still) for a, b in zip(ends, starts, strict=True)]
    )
    factor = tabulate_lengths(n_samples, 0, s, p, longest, model)
    evidence = SpanEvidence(np.ascontiguousarray(speeds), factor, model)
    return Spans(evidence, starts, ends, rest, np.concatenate([[False], sure, [False]]), given)


def first_sample(first: int, rate_hz: float) -> int:
    """Return the last sample of the evidence that is not after a place on the grid."""
    return int(np.floor(first / GRID_HZ * rate_hz + 1e-9))


def _evaluate_rest(speeds: FloatArray, p: float, model: VmciModel) -> float:
    """Evaluate a rest of n samples; a turning point has no samples and no length."""
    n, s = speeds.shape
    if n == 0:
        return 0.0
    length = (n - 1) * np.log1p(-p) + np.log(p)
    scatter = speeds.T @ speeds + model.noise_scale * np.eye(s)
    evidence = length_factor(np.array([float(n)]), s, model)[0]
    evidence -= 0.5 * (n + model.nu(s)) * np.linalg.slogdet(scatter)[1]
    return float(length + evidence)
