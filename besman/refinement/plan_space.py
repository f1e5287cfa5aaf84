"""The motion plans around one: what a search may change, in comparable units."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from besman.imitation.dmp import dmp_basis, goal_response, shape_directions
from besman.records import MotionPlan
from besman.refinement.search import Part
from besman.robot.limits import time_stretch
from besman.robot.parts import JointLimits

FloatArray = npt.NDArray[np.float64]

# The movement is looked at in 500 places; between them it can be this much faster.
_MARGIN = 1.0 + 2e-4


@dataclass(frozen=True)
class Units:
    """What one unit of the search changes.

    Attributes
    ----------
    goal_rad : float
        Goal of a joint.
    log_duration : float
        Natural logarithm of the duration.
    shape_rad : float
        Root mean square over the movement by which the smoothest change of a joint's weights
        moves that joint; rougher ones move it less, with the same acceleration.
    """

    goal_rad: float = 0.1
    log_duration: float = 0.1
    shape_rad: float = 0.1


class PlanSpace:
    """Motion plans that differ from a first one in goal, duration and weights.

    Every plan starts and ends at rest, and lasts as long as the arm's limits of velocity and
    acceleration require.

    Parameters
    ----------
    plan : MotionPlan
        The origin.
    limits : JointLimits
        Of the arm.
    parts : tuple of "goal", "duration", "weights"
        What may change.
    n_shapes : int
        How many changes of the weights per joint, the smoothest first.
    units : Units
        What one unit is.
    """

    def __init__(
        self,
        plan: MotionPlan,
        limits: JointLimits,
        parts: tuple[Part, ...],
        n_shapes: int,
        units: Units = Units(),
    ) -> None:
        self._plan, self._limits, self._parts, self._units = plan, limits, parts, units
        n, n_weights = plan.weights.shape
        self._goal_response = goal_response(n_weights)
        self._shapes = shape_directions(n_weights)[:n_shapes]
        sizes = {"goal": n, "duration": 1, "weights": n * len(self._shapes)}
        self._sizes = [sizes[part] for part in parts]

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return sum(self._sizes)

    def plan_at(self, point: npt.ArrayLike) -> MotionPlan:
        """Return the motion plan at a point, shape (D,)."""
        start, n = self._plan, len(self._plan.goal)
        ends = np.cumsum(self._sizes)[:-1]
        pieces = dict(zip(self._parts, np.split(np.asarray(point), ends), strict=True))
        weights, goal, duration = start.weights, start.goal, start.duration
        if "goal" in pieces:
            moved = self._units.goal_rad * pieces["goal"]
            goal = goal + moved
            weights = weights + np.outer(moved, self._goal_response)
        if "weights" in pieces:
            shape = self._units.shape_rad * pieces["weights"].reshape(n, -1)
            weights = weights + shape @ self._shapes
        if "duration" in pieces:
            # Bounded, because nothing is learnt from movements of a minute or a millisecond.
            stretch = np.clip(self._units.log_duration * pieces["duration"][0], -2.0, 2.0)
            duration = duration * float(np.exp(stretch))
        duration = max(duration, least_duration(weights, start.start, goal, self._limits))
        return replace(start, weights=weights, goal=goal, duration=duration)


def least_duration(
    weights: FloatArray, start: FloatArray, goal: FloatArray, limits: JointLimits
) -> float:
    """Compute how long a DMP must last to keep the limits of velocity and acceleration.

    Parameters
    ----------
    weights : array, shape (n, K)
        Of the forcing term.
    start, goal : array, shape (n,)
        rad.
    limits : JointLimits
        Of the arm.

    Returns
    -------
    float
        Seconds.
    """
    basis = dmp_basis(weights.shape[1])
    parameters = np.column_stack([start, goal, weights]).T
    # As if it lasted one second.
    stretch = time_stretch(limits, basis.velocity @ parameters, basis.acceleration @ parameters)
    return _MARGIN * stretch
