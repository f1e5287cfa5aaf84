"""A behaviour template: from a context to a motion plan, and to what may be expected of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from besman.motion.forcing import count_nodes
from besman.motion.rollout import roll_out_plans, stretch_plan
from besman.records import AnyPlan, Record, freeze
from besman.robot.dynamics import inverse_dynamics
from besman.robot.model import Robot
from besman.search.protocol import Part
from besman.search.upper_level import UpperLevelPolicy
from besman.stages.refine.plan_space import Space, Units, plan_space
from besman.templates.contexts import ContextKind
from besman.templates.learning import Tries

FloatArray = npt.NDArray[np.float64]

# Episodes count by their distance in the context, as a share of half the region.
_NEAR = 0.3
_RESERVE = 1.002


@dataclass(frozen=True, eq=False)
class PlanFamily(Record, stored_as="besman.templates.template:PlanFamily"):
    """The motion plans around one from which a context chooses.

    Attributes
    ----------
    base : MotionPlan or CartesianPlan
        The plan of the origin.
    names : tuple of str
        Coordinates of the context.
    search : tuple of "goal", "duration", "weights"
    n_shapes : int
    units : Units
        See `besman.stages.refine.plan_space.PlanSpace`.
    """

    base: AnyPlan
    names: tuple[str, ...]
    search: tuple[Part, ...]
    n_shapes: int
    units: Units

    def space(self, robot: Robot) -> Space:
        """Return the vector space of the plans."""
        return plan_space(self.base, robot, self.search, self.n_shapes, self.units)

    def plans(
        self, robot: Robot, kind: ContextKind, points: FloatArray, contexts: FloatArray
    ) -> list[AnyPlan]:
        """Return the plans of points (P, D) for contexts (P, S), slow enough for the arm."""
        space = self.space(robot)
        return [
            slow_to_torque(kind.place(space.plan_at(point), self.names, context), robot)
            for point, context in zip(points, contexts, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class Template(
    Record,
    stored_as="besman.templates.template:Template",
    finite=("region",),
):
    """A behaviour template.

    Attributes
    ----------
    method : str
        What it was learnt by.
    robot, tool, task : str
        As in the run's pipeline.
    family : PlanFamily
    region : array, shape (2, S)
        Least and greatest context that were learnt.
    policy : UpperLevelPolicy
        From contexts to points of the family.
    tries, checks : Tries
        See `besman.templates.learning.learn_policy`.
    """

    method: str
    robot: str
    tool: str
    task: str
    family: PlanFamily
    region: FloatArray
    policy: UpperLevelPolicy
    tries: Tries
    checks: Tries

    def __post_init__(self) -> None:
        """Copy the region, make it read-only and check its shape."""
        freeze(self, {"region": (2, "S")})


@dataclass(frozen=True)
class Forecast:
    """What may be expected of a template in a context.

    Attributes
    ----------
    reward, reward_spread : float
        Mean and standard deviation of the rewards nearby.
    miss : float
        Mean miss nearby, metres; NaN where everything failed.
    success : float
        Share of successes nearby, 0 to 1.
    """

    reward: float
    reward_spread: float
    miss: float
    success: float


def forecast(template: Template, context: npt.ArrayLike) -> Forecast:
    """Predict what comes of a template in a context, from the policy's episodes nearby.

    Kernel regression over the contexts that were tried without exploration.

    Parameters
    ----------
    template : Template
    context : array, shape (S,)

    Returns
    -------
    Forecast

    References
    ----------
    E. A. Nadaraya: On Estimating Regression. Theory of Probability and Its Applications 9 (1964),
    DOI 10.1137/1109020.
    """
    checks = template.checks
    half = 0.5 * (template.region[1] - template.region[0])
    distances = np.linalg.norm((checks.contexts - np.asarray(context)) / half, axis=1)
    # Relative to the nearest, so that far outside the region something is left to go by.
    closeness = np.exp(-0.5 * (distances**2 - distances.min() ** 2) / _NEAR**2)
    weights = closeness / closeness.sum()
    reward = float(weights @ checks.rewards)
    landed = np.isfinite(checks.misses)
    share = float(weights[landed].sum())
    return Forecast(
        reward=reward,
        reward_spread=float(np.sqrt(weights @ (checks.rewards - reward) ** 2)),
        miss=float(weights[landed] @ checks.misses[landed]) / share if share > 0 else np.nan,
        success=float(weights @ checks.successes),
    )


def outside(template: Template, context: npt.ArrayLike) -> str:
    """Say by how much a context is outside the region that was learnt; "" if it is not."""
    low, high = template.region
    parts = []
    for name, value, least, most in zip(
        template.family.names, np.asarray(context), low, high, strict=True
    ):
        beyond = max(least - value, value - most)
        if beyond > 0:
            unit = "deg" if name.endswith("_deg") else "m"
            parts.append(
                f"{name}: got {value:g}, learnt {least:.3g} to {most:.3g} (outside by "
                f"{beyond:.2g} {unit})"
            )
    return "; ".join(parts)


def slow_to_torque(plan: AnyPlan, robot: Robot) -> AnyPlan:
    """Lengthen a plan until its torques are within their limits, evenly.

    What moves the arm falls with the square of the duration; what holds it does not, and where
    that alone exceeds a limit nothing helps.
    """
    time = np.linspace(0.0, plan.duration, count_nodes(plan.weights.shape[1]) // 2)
    q, v, a = (part[0] for part in roll_out_plans([plan], time, robot))
    limits, still = robot.limits.torque, np.zeros_like(q)
    holding = inverse_dynamics(robot, q, still, still)
    moving = inverse_dynamics(robot, q, v, a) - holding
    room = limits - np.sign(moving) * holding
    held = np.abs(holding) < limits
    square = np.max(np.abs(moving[held]) / room[held], initial=0.0)
    if square <= 1.0:
        return plan
    return stretch_plan(plan, plan.duration * _RESERVE * float(np.sqrt(square)))


def with_name(plan: AnyPlan, names: tuple[str, ...], context: npt.ArrayLike) -> AnyPlan:
    """Name a plan after its context."""
    values = zip(names, np.asarray(context, dtype=np.float64), strict=True)
    return replace(plan, name="_".join(f"{name}{value:.3f}" for name, value in values))
