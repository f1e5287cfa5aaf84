"""A movement that stands still for a while where it is at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


class Waits(NamedTuple):
    """When a movement waits.

    Attributes
    ----------
    moments_s : array, shape (K,)
        On the movement's own clock, rising.
    starts_s : array, shape (K,)
        The same moments on the clock on which it waits.
    waits_s : array, shape (K,)
        For how long.
    """

    moments_s: FloatArray
    starts_s: FloatArray
    waits_s: FloatArray

    @property
    def sum_s(self) -> float:
        """All waits together, seconds."""
        return float(self.waits_s.sum())

    def own_time(self, time: npt.ArrayLike) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return the movement's own clock, and whether it goes on.

        Parameters
        ----------
        time : array, shape (T,)
            Seconds, on the clock on which it waits.

        Returns
        -------
        own : array, shape (T,)
            Seconds.
        moving : bool array, shape (T,)
        """
        now = np.asarray(time, dtype=np.float64)
        since = now[:, np.newaxis] - self.starts_s
        own = now - np.clip(since, 0.0, self.waits_s).sum(axis=1)
        waiting = np.any((since >= 0.0) & (since < self.waits_s), axis=1)
        return own, np.logical_not(waiting)


def add_waits(moments_s: npt.ArrayLike, waits_s: npt.ArrayLike) -> Waits:
    """Let a movement wait at moments at which it is at rest.

    Parameters
    ----------
    moments_s : array, shape (K,)
        Seconds on its own clock, rising.
    waits_s : array, shape (K,)
        For how long, seconds.
    """
    moments = np.asarray(moments_s, dtype=np.float64).reshape(-1)
    waits = np.asarray(waits_s, dtype=np.float64).reshape(-1)
    before = np.concatenate([[0.0], np.cumsum(waits)[:-1]])[: len(waits)]
    return Waits(moments, moments + before, waits)
