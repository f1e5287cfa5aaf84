"""Bell-shaped speed profiles and their superposition."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import beta, betainc

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Bell:
    """A movement whose speed rises and falls once.

    The speed is a beta density over the movement's duration. Sharpness 4 with its peak in the
    middle is the minimum-jerk profile [1]_; a peak elsewhere makes it uneven. Movements that
    overlap in time add up [2]_.

    Attributes
    ----------
    start : float
        Seconds.
    duration : float
        Seconds.
    peak : float
        Share of the duration at which the speed is greatest, 0 to 1.
    sharpness : float
        Sum of the two exponents; above 2 / min(peak, 1 - peak) the acceleration is smooth at
        both ends.

    References
    ----------
    .. [1] T. Flash, N. Hogan: The coordination of arm movements. Journal of Neuroscience 5(7),
       1985, eq. 3. doi:10.1523/JNEUROSCI.05-07-01688.1985
    .. [2] T. Flash, E. Henis: Arm trajectory modifications during reaching towards visual
       targets. Journal of Cognitive Neuroscience 3(3), 1991. doi:10.1162/jocn.1991.3.3.220
    """

    start: float
    duration: float
    peak: float = 0.5
    sharpness: float = 4.0

    @property
    def end(self) -> float:
        """When the movement is over, seconds."""
        return self.start + self.duration

    @property
    def peak_time(self) -> float:
        """When the movement is fastest, seconds."""
        return self.start + self.peak * self.duration

    @property
    def peak_rate(self) -> float:
        """Greatest slope of `progress`, 1/s."""
        rise, fall = self._exponents()
        density = self.peak**rise * (1.0 - self.peak) ** fall / beta(rise + 1.0, fall + 1.0)
        return float(density / self.duration)

    def progress(self, time: FloatArray) -> FloatArray:
        """Share of the way done, from 0 before the movement to 1 after it, shape of `time` (s)."""
        rise, fall = self._exponents()
        share = np.clip((time - self.start) / self.duration, 0.0, 1.0)
        done: FloatArray = betainc(rise + 1.0, fall + 1.0, share)
        return done

    def _exponents(self) -> tuple[float, float]:
        """Exponents of the rising and the falling side."""
        return self.peak * self.sharpness, (1.0 - self.peak) * self.sharpness
