"""What an arm can do of a demonstration at most, wherever it is placed: known before any search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Fit:
    """Bounds that no placement of a demonstration beats.

    Attributes
    ----------
    extent_m : float
        Greatest distance between two places of the tool, metres.
    span_m : float
        Greatest distance that two places of the arm's tool can have, metres.
    speed_m_s : float
        The tool's greatest speed asked for, m/s.
    greatest_speed_m_s : float
        What all joints at their limits give a stretched-out arm, m/s.
    """

    extent_m: float
    span_m: float
    speed_m_s: float
    greatest_speed_m_s: float

    @property
    def scale(self) -> float:
        """Greatest factor by which the movement fits, at most 1."""
        return min(1.0, self.span_m / self.extent_m) if self.extent_m > 0 else 1.0

    @property
    def speed_share(self) -> float:
        """Greatest share of the demonstrated speed that the arm can have, at most 1."""
        return min(1.0, self.greatest_speed_m_s / self.speed_m_s) if self.speed_m_s > 0 else 1.0


def what_fits(robot: Robot, time: FloatArray, poses: FloatArray, allowed_m: float = 0.0) -> Fit:
    """Hold a demonstration against what an arm can reach and how fast its tool can be.

    The tool is never further from a joint than the links from there on are long, so two of its
    places are at most twice the arm's length apart, and its speed is at most the sum of the joints'
    speeds times these lengths.

    Parameters
    ----------
    robot : Robot
    time : array, shape (T,)
        Seconds, rising.
    poses : array, shape (T, 4, 4)
        What is asked of the tool centre point, in any fixed frame, metres.
    allowed_m : float
        Position error that is allowed, metres.

    Returns
    -------
    Fit
    """
    steps = np.linalg.norm(robot.chain.placements[1:, :3, 3], axis=1)
    links = np.append(steps, np.linalg.norm(robot.chain.tip[:3, 3]))
    lengths = np.cumsum(links[::-1])[::-1]
    places = poses[:, :3, 3]
    away = np.linalg.norm(places[:, None] - places[None], axis=2)
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(time)
    return Fit(
        extent_m=float(away.max()),
        span_m=float(2.0 * (lengths[0] + allowed_m)),
        speed_m_s=float(speeds.max(initial=0.0)),
        greatest_speed_m_s=float(robot.limits.velocity @ lengths),
    )


def why_it_cannot_fit(fit: Fit, least_scale: float) -> str:
    """Say why no placement serves a demonstration; empty if one may.

    Parameters
    ----------
    fit : Fit
    least_scale : float
        Factor by which movements may be made smaller.
    """
    if fit.scale >= least_scale:
        return ""
    words = (
        f"its tool's places are up to {fit.extent_m:.2f} m apart, the arm's at most "
        f"{fit.span_m:.2f} m; made smaller by {np.floor(100 * fit.scale) / 100:.2f} it may fit "
        "(map: scale)"
    )
    if fit.speed_share < 1.0:
        words += f"; the arm has at most {fit.speed_share:.0%} of its speed"
    return words
