"""Which returns a search can learn from."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

BoolArray = npt.NDArray[np.bool_]


def usable(returns: npt.ArrayLike) -> BoolArray:
    """Tell which episodes a search can learn from.

    Parameters
    ----------
    returns : array, shape (P,) or (P, T)
        Of episodes, or of every moment of them.

    Returns
    -------
    array of bool, shape (P,)
        Episodes without a return that is not finite.
    """
    finite = np.isfinite(np.asarray(returns, dtype=np.float64))
    return np.asarray(finite if finite.ndim == 1 else finite.all(axis=1), dtype=np.bool_)
