"""How people are built: the lengths of an arm, and how upright a back is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.geometry.row_blocks import by_rows, measure_apart

FloatArray = npt.NDArray[np.float64]

HEIGHTS_M = (1.1, 2.2)
"""From a child of five to the tallest of adults."""

# A marker is stuck on near a joint, not in it.
_BESIDE_JOINT_M = 0.1
# Of a limb between two markers that are stuck on: skin moves, and a wrist bends.
_MOST_CHANGE = 0.25
_TYPICAL_HEIGHT_M = 1.7
# As powers of ten: units that are confused are 10, 100 or 1000 times each other.
_NEAR_A_POWER = 0.35
_UPRIGHT_SHARE = 0.1


class Limb(NamedTuple):
    """A limb between the markers of two roles.

    Attributes
    ----------
    first, second : str
        Roles of a marker set.
    least_share, most_share : float
        Its shortest and longest possible length, as shares of the body's height.
    """

    first: str
    second: str
    least_share: float
    most_share: float

    @property
    def range_m(self) -> tuple[float, float]:
        """Shortest and longest distance of the two markers on anybody, metres."""
        low = self.least_share * HEIGHTS_M[0] - _BESIDE_JOINT_M
        return round(low, 2), round(self.most_share * HEIGHTS_M[1] + _BESIDE_JOINT_M, 2)

    @property
    def typical_m(self) -> float:
        """Its length on a person of 1.7 m, metres."""
        return 0.5 * (self.least_share + self.most_share) * _TYPICAL_HEIGHT_M


LIMBS = (Limb("shoulder", "elbow", 0.186, 0.186), Limb("elbow", "hand", 0.146, 0.146 + 0.108))
"""Upper arm and forearm; what is called the hand is anywhere from the wrist to the fingertips.

References
----------
D. A. Winter, *Biomechanics and Motor Control of Human Movement* (2009), figure 4.1, after
R. Drillis and R. Contini (1966): upper arm 0.186, forearm 0.146, hand 0.108 of the height.
https://doi.org/10.1002/9780470549148
"""


class LimbLength(NamedTuple):
    """A limb as a recording shows it.

    Attributes
    ----------
    limb : Limb
    length_m : float
        Median distance of its markers, metres.
    change : float
        Standard deviation of that distance, as a share of its median.
    """

    limb: Limb
    length_m: float
    change: float

    @property
    def is_human(self) -> bool:
        """Whether anybody has a limb of this length."""
        low, high = self.limb.range_m
        return low <= self.length_m <= high

    @property
    def is_steady(self) -> bool:
        """Whether the limb keeps its length."""
        return self.change <= _MOST_CHANGE


def measure_limbs(points: Mapping[str, FloatArray]) -> list[LimbLength]:
    """Measure the limbs of one arm.

    Parameters
    ----------
    points : mapping of str to array, shape (T, 3)
        Markers by role (shoulder, elbow, hand), metres; NaN where not seen.

    Returns
    -------
    list of LimbLength
        Of `LIMBS`, those whose two markers are seen together.
    """
    lengths = []
    for limb in LIMBS:
        if limb.first not in points or limb.second not in points:
            continue
        apart = measure_apart(points[limb.first], points[limb.second])
        apart = apart[np.isfinite(apart)]
        if apart.size:
            length = float(np.median(apart))
            change = float(np.std(apart)) / length if length > 0.0 else np.inf
            lengths.append(LimbLength(limb, length, change))
    return lengths


def find_scale(limbs: list[LimbLength]) -> float | None:
    """Tell by which power of ten a person is too large or too small.

    Parameters
    ----------
    limbs : list of LimbLength
        Of one arm.

    Returns
    -------
    float or None
        10.0 if all is ten times as long as people are; None where a limb is as long as anybody's,
        where there are fewer than two, or where no power of ten explains their lengths.
    """
    if len(limbs) < len(LIMBS) or any(one.is_human or one.length_m <= 0.0 for one in limbs):
        return None
    powers = [float(np.log10(one.length_m / one.limb.typical_m)) for one in limbs]
    power = round(float(np.mean(powers)))
    if power == 0 or any(abs(one - power) > _NEAR_A_POWER for one in powers):
        return None
    return float(10.0**power)


def measure_upright(top: FloatArray, left: FloatArray, right: FloatArray) -> float:
    """Measure how upright a back is when it is most upright.

    Parameters
    ----------
    top, left, right : array, shape (T, 3)
        Markers on the back, the first above the others, metres, z up; NaN where not seen.

    Returns
    -------
    float
        Angle between the back and the vertical that it stays below for a tenth of the time,
        degrees; NaN if the three are never seen together.
    """

    def measure(top: FloatArray, left: FloatArray, right: FloatArray) -> FloatArray:
        up = top - 0.5 * (left + right)
        with np.errstate(invalid="ignore", divide="ignore"):
            cosine = np.clip(up[:, 2] / np.linalg.norm(up, axis=1), -1.0, 1.0)
            return np.asarray(np.degrees(np.arccos(cosine)))

    lean = by_rows(measure, top, left, right)
    lean = lean[np.isfinite(lean)]
    return float(np.quantile(lean, _UPRIGHT_SHARE)) if lean.size else float("nan")
