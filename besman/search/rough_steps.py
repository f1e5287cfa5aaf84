"""Where steps go on from where outcomes are rough: what one of them says may be chance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from besman.search.residual_points import Tried

FloatArray = npt.NDArray[np.float64]

BESIDE = 1e-3
"""How far beside a start without an outcome it begins: a movement is brought into limits there."""
FAR = 4.0
"""Beyond this an outcome is off for no chance of contacts: steps in vain were too long."""

# After a first step in vain the next goes as far from a place beside, so far off in units; after so
# many in vain they begin anew so far off.
_BESIDE, _IN_VAIN, _ANEW = 0.7, 2, 2.5


class RoughSteps:
    """Chooses where the next step begins.

    A step that has led to more is no reason for a shorter one: contacts make an outcome jump
    between branches along which it is smooth. The same step from beside may stay on the branch; and
    if that is in vain too, it may be smooth elsewhere. Ways aside are along the free directions, so
    that the outcome is the same, as far as is known.

    Parameters
    ----------
    seed : tuple of int
        Of the directions aside.
    """

    def __init__(self, seed: tuple[int, ...]) -> None:
        self._random = np.random.default_rng(seed)
        self._in_vain, self._away = 0, False

    def begin(self) -> None:
        """Forget which steps were in vain."""
        self._in_vain, self._away = 0, False

    def judge(self, before: Tried, after: Tried) -> Tried:
        """Return where to go on from after a step."""
        if self._away:
            self.begin()
            return after if after.cost < np.inf else before
        gained = after.cost < before.cost
        self._in_vain = 0 if gained else self._in_vain + 1
        return after if gained else before

    def begins_anew(self, best: Tried, slopes: FloatArray) -> FloatArray | None:
        """Return the point (D,) far from the best where steps begin anew; None if they go on.

        `slopes`, shape (R, D), are those of the outcome.
        """
        if self._in_vain < _IN_VAIN:
            return None
        self._away = True
        return best.point + _ANEW * self._direction(slopes)

    def beside(
        self, at: Tried, slopes: FloatArray, within: Callable[[FloatArray], FloatArray]
    ) -> Tried:
        """Return where the next step begins, with the outcome that is to be expected there."""
        if not self._in_vain:
            return at
        point = within(at.point + _BESIDE * self._direction(slopes))
        return Tried(point, at.residuals[:1] + slopes @ (point - at.point))

    def _direction(self, slopes: FloatArray) -> FloatArray:
        """Draw a direction, shape (D,), of the coordinates that have slopes."""
        drawn = self._random.standard_normal(slopes.shape[1]) * slopes.any(axis=0)
        drawn -= np.linalg.pinv(slopes) @ (slopes @ drawn)
        return np.asarray(drawn / max(float(np.linalg.norm(drawn)), 1e-12))
