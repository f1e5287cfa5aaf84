"""Ways of a task in the order in which they are worth simulating."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple, TypeVar

from besman.exceptions import PlanError
from besman.motion.adapt_task import keep_task_limits
from besman.records import TaskPlan
from besman.robot.model import Robot

Way = TypeVar("Way")

CLEAR_M = 0.002
"""What touches nothing is so far from it: the arm follows a movement to a millimetre or two."""

# Of ways that touch something so many are simulated: a fingertip may push a box a little.
_MOST_TOUCHING = 12
# A way that is so much slower than it was shown leads past a singularity.
_SLOW = 2.5


class Led(NamedTuple):
    """A way that is brought to its objects.

    Attributes
    ----------
    plan : TaskPlan
        As fast as it comes: `besman.motion.adapt_task.keep_task_limits` is to follow.
    clearance_m : float
    """

    plan: TaskPlan
    clearance_m: float


def list_aimed(
    ways: Iterable[Way],
    lead: Callable[[Way], Led],
    robot: Robot,
    failed: Callable[[Way, PlanError], None] = lambda way, error: None,
) -> Iterator[tuple[Way, TaskPlan]]:
    """Return ways within the arm's limits, clear ones first, each made when it is asked for.

    Those that touch nothing come in their order; then those that would have to be very slow, and
    those that touch something, the ones that do so least first.

    Parameters
    ----------
    ways : iterable
    lead : callable
        Brings a way to its objects; a PlanError where that is out of reach.
    robot : Robot
    failed : callable
        Is told of a way that is out of reach or limits.
    """
    slow: list[tuple[Way, TaskPlan]] = []
    touching: list[tuple[float, int, Way, TaskPlan]] = []
    for number, way in enumerate(ways):
        try:
            led = lead(way)
            if led.clearance_m < CLEAR_M:
                touching.append((-led.clearance_m, number, way, led.plan))
                continue
            kept = keep_task_limits(led.plan, robot)
        except PlanError as error:
            failed(way, error)
            continue
        if kept.duration > _SLOW * led.plan.duration:
            slow.append((way, kept))
            continue
        yield way, kept
    yield from slow
    touching.sort(key=lambda one: one[:2])
    for _, _, way, plan in touching[:_MOST_TOUCHING]:
        try:
            yield way, keep_task_limits(plan, robot)
        except PlanError as error:
            failed(way, error)
