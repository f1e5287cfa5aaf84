"""Whether somebody rests next: a habit, and how fast the hand still was as a movement ended."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from besman.records import LabelledSegments
from besman.records.layers import IDLE

FloatArray = npt.NDArray[np.float64]

# Whether somebody rests is a habit: however often others did, it counts as half a sighting; each of
# one's own counts as one, after whichever movement.
_MOST_SIGHTINGS = 0.5

# Slower is standing still: a tremor, and the noise of cameras.
_STILL_M_S = 0.01


class Rests:
    """How probable a rest is after the blocks so far.

    Habits give its odds. They are multiplied by how much more often a hand that was so fast as the
    movement ended came to rest: who has stopped already goes on; who has not yet takes a rest, the
    beginning of which is the end of that movement. The logarithm of this factor is linear in that
    of the speed (logistic regression, weights drawn towards zero as by one unit of variance).

    Parameters
    ----------
    blocks : sequence of LabelledSegments
        Of each recording in the order of time, rests among them as ``idle``.
    end_speed : callable
        Takes one of them and the row at which a block begins; returns the speed of the hand just
        before, m/s, NaN if it is not known.

    References
    ----------
    C. M. Bishop: Pattern Recognition and Machine Learning, 2006, eq. 4.87 (logistic regression) and
    4.153 (odds of classes as often as another prior has them).
    """

    def __init__(
        self,
        blocks: Sequence[LabelledSegments],
        end_speed: Callable[[LabelledSegments, int], float] = lambda found, row: float("nan"),
    ) -> None:
        self._counts = _count_rests(blocks)
        # Where nobody ever rests, a speed says nothing of rests.
        cases = [
            (end_speed(found, int(found.bounds[k, 0])), found.labels[k] == IDLE)
            for found in blocks
            for k in range(1, len(found.labels))
            if self._counts[found.labels[k - 1]][0] and follows_at_once(found, k)
        ]
        known = [(speed, rests) for speed, rests in cases if np.isfinite(speed)]
        self._centre, self._spread, self._slope, self._offset = 0.0, 1.0, 0.0, 0.0
        if len({rests for _, rests in known}) == 2:
            self._learn(
                np.log(_STILL_M_S + np.array([speed for speed, _ in known])),
                np.array([rests for _, rests in known]),
            )

    def probability(self, before: Sequence[str], speed_m_s: float = float("nan")) -> float:
        """Return how probable it is that a rest comes next.

        Parameters
        ----------
        before : sequence of str
            Labels of the blocks so far, rests among them.
        speed_m_s : float
            Of the hand as the last of them ended; NaN if it is not known.
        """
        rests, n = self._counts.get(before[-1] if before else "", (0, 0))
        weight = min(n, _MOST_SIGHTINGS)
        moved = bool(before) and before[-1] != IDLE
        own, chances = _own_rests(before) if moved else (0, 0)
        rest = (weight * rests / max(n, 1) + own + 0.5) / (weight + chances + 1.0)
        if not moved or not np.isfinite(speed_m_s):
            return rest
        place = (np.log(_STILL_M_S + speed_m_s) - self._centre) / self._spread
        factor = np.exp(self._slope * place + self._offset)
        return float(rest * factor / (rest * factor + 1.0 - rest))

    def _learn(self, speeds: FloatArray, rests: npt.NDArray[np.bool_]) -> None:
        """Learn how the odds of a rest depend on the logarithm of a speed."""
        from sklearn.linear_model import LogisticRegression

        self._centre = float(speeds.mean())
        self._spread = max(float(speeds.std()), 1e-6)
        model = LogisticRegression().fit(((speeds - self._centre) / self._spread)[:, None], rests)
        self._slope = float(model.coef_[0, 0])
        self._offset = float(model.intercept_[0] - np.log(rests.sum() / (~rests).sum()))


def follows_at_once(found: LabelledSegments, k: int) -> bool:
    """Tell whether a block begins where a movement ends: there may be a stretch without a name."""
    return k > 0 and found.labels[k - 1] != IDLE and found.bounds[k - 1, 1] == found.bounds[k, 0]


def _own_rests(before: Sequence[str]) -> tuple[int, int]:
    """Return how often somebody rested after a movement so far, and how often that could be."""
    after = [label for last, label in pairwise(before) if last != IDLE]
    return after.count(IDLE), len(after)


def _count_rests(blocks: Sequence[LabelledSegments]) -> dict[str, tuple[int, int]]:
    """Return for each label, "" for the beginning, how often a rest came next, and of how many."""
    counts: defaultdict[str, list[int]] = defaultdict(lambda: [0, 0])
    for found in blocks:
        for before, label in zip(("", *found.labels), found.labels, strict=False):
            counts[before][0] += label == IDLE
            counts[before][1] += 1
    return {label: (rests, n) for label, (rests, n) in counts.items()}
