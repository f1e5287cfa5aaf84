"""Distances as texts, one digit behind the point."""

from __future__ import annotations

import math


def centimetres(metres: float | None, unknown: str = "-") -> str:
    """Write a distance in centimetres.

    Parameters
    ----------
    metres : float, optional
        NaN, infinite or none if it is not known.
    unknown : str
        What stands there then.
    """
    if metres is None or not math.isfinite(metres):
        return unknown
    return f"{100 * metres:.1f} cm"
