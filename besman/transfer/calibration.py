"""What landings on the real arm say of the simulation's model: its parameters.

A throw says two numbers of an arm of which some forty are not known. So they are estimated with
what is likely beforehand [1]_: of all models in which the tries so far come down where they did,
the one that is nearest to the model as it is, in standard deviations of what models are off by.
Every try of an arm counts, whichever motion it was of: what one throw has told of the arm, the next
one begins with.

References
----------
.. [1] A. Tarantola: Inverse problem theory and methods for model parameter estimation, SIAM 2005,
   section 3.4.5, equation 3.51 (quasi-Newton's maximum of the posterior density),
   DOI 10.1137/1.9780898717921.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.perturbation import Perturbation
from besman.simulation.perturbed_trials import try_perturbed
from besman.simulation.task import Task
from besman.stages.refine.plan_space import Space
from besman.transfer.approach import FAILED_M, RealTry
from besman.transfer.archive import Archive, Simulator

FloatArray = npt.NDArray[np.float64]

# What a model is off by, standard deviations. Lags, frictions and dampings have a part that all
# joints share, since one controller smooths for all, and one of each; the latter two are shares of
# the torque limit.
_LOG_FRICTION, _LOG_MASS, _LOG_GAIN = 0.3, 0.15, 0.25
_LAGS_S, _LAG_S = 0.1, 0.05
_FRICTIONS, _FRICTION = 0.05, 0.03
_OFFSET_RAD = 0.01
# How far a throw may come down from where the right model says: it is not thrown twice alike.
_LANDING_M = 0.03
# Half a standard deviation makes a difference that contacts do not drown.
_STEP = 0.5
_ITERATIONS, _SHORTER, _SHORTENINGS = 4, 0.5, 4
# What a better fit gains at least, of the negative logarithm of the density, doubled.
_GAIN = 1.0
# The newest tries of an arm that are looked at; and how far off a throw counts at most, metres.
_MOST_TRIES, _FARTHEST_M = 12, 1.0


@dataclass(frozen=True, eq=False)
class Touchdown:
    """Where a motion came down on the real arm.

    Attributes
    ----------
    plan : MotionPlan or CartesianPlan
    outcome : array, shape (2,)
        Metres ahead and to the left.
    """

    plan: AnyPlan
    outcome: FloatArray


def calibrate(
    robot: Robot,
    task: Task,
    landings: Sequence[Touchdown],
    jobs: int = 1,
    progress: Callable[[float], None] = lambda done: None,
) -> Perturbation | None:
    """Return the model in which throws come down where they did, and that is likeliest.

    Parameters
    ----------
    robot, task
        The model as it is.
    landings : sequence of Touchdown
        Throws of the real arm that came down, the newest last.
    jobs : int
        Threads; they change nothing.
    progress : callable
        Called with the share done, 0 to 1.

    Returns
    -------
    Perturbation or None
        None if no landing says anything: there are none, or none of them comes down in the model.
    """
    landings = landings[-_MOST_TRIES:]
    if not landings:
        return None
    real = np.array([one.outcome for one in landings])

    def off(points: FloatArray) -> FloatArray:
        """Return by how much models (P, D) are off, shape (P, R, 2), standard deviations."""
        worlds = [world_at(robot, point) for point in points]

        def land(landing: Touchdown) -> list[FloatArray]:
            trials = try_perturbed(robot, task, landing.plan, worlds)
            return [np.where(one.failure == "", one.outcome[:2], np.nan) for one in trials]

        with ThreadPoolExecutor(jobs) as threads:
            landed = np.array(list(threads.map(land, landings))).transpose(1, 0, 2)
        return np.asarray((landed - real) / _LANDING_M)

    point = _most_likely(off, n_model_parameters(robot), progress)
    return None if point is None else world_at(robot, point)


def calibrated(
    simulator: Simulator,
    landings: Sequence[Touchdown],
    jobs: int = 1,
    progress: Callable[[float], None] = lambda done: None,
) -> Simulator | None:
    """Return a simulator of what `calibrate` says; None if landings say nothing."""
    world = calibrate(simulator.robot, simulator.task, landings, jobs, progress)
    return None if world is None else replace(simulator, world=world)


def landings_of(space: Space, archive: Archive, tries: Sequence[RealTry]) -> list[Touchdown]:
    """Return those of a motion's tries that came down about where they were to.

    That is near the target, if they were aimed in a model that is far from the simulation as it is.
    """
    found = []
    for one in tries:
        plan = space.plan_at(archive.points[one.row])
        aims = np.stack([archive.outcomes[one.row], plan.target[:2]])
        if (np.linalg.norm(one.outcome - aims, axis=1) <= FAILED_M).any():
            found.append(Touchdown(plan, one.outcome))
    return found


def n_model_parameters(robot: Robot) -> int:
    """Return how many parameters a model has."""
    return 5 + 5 * robot.n


def world_at(robot: Robot, point: FloatArray) -> Perturbation:
    """Return the model of parameters (D,), in standard deviations off the model as it is.

    What cannot be less than nothing is nothing there.
    """
    n, limits = robot.n, robot.limits
    shared, own = point[:5], point[5:].reshape(5, n)

    def at_least_none(of_all: float, of_each: float, place: int) -> FloatArray:
        return np.asarray(np.maximum(of_all * shared[2 + place] + of_each * own[place], 0.0))

    return Perturbation(
        friction=float(np.exp(_LOG_FRICTION * shared[0])),
        object_mass=float(np.exp(_LOG_MASS * shared[1])),
        link_masses=np.ones(n),
        servo_gains=np.exp(_LOG_GAIN * own[3]),
        joint_friction=limits.torque * at_least_none(_FRICTIONS, _FRICTION, 1),
        joint_damping=limits.torque / limits.velocity * at_least_none(_FRICTIONS, _FRICTION, 2),
        delays=np.zeros(n),
        lags=at_least_none(_LAGS_S, _LAG_S, 0),
        backlash=np.zeros(n),
        offsets=_OFFSET_RAD * own[4],
    )


def _most_likely(
    off: Callable[[FloatArray], FloatArray], n: int, progress: Callable[[float], None]
) -> FloatArray | None:
    """Return the parameters (D,) of greatest posterior density by Gauss-Newton steps [1]_."""
    point = np.zeros(n)
    here = off(point[None])[0]
    if not np.isfinite(here).any():
        return None
    for iteration in range(_ITERATIONS):
        progress(iteration / _ITERATIONS)
        ahead = off(point + _STEP * np.eye(n))
        # A throw that fails in a model says nothing of the way there.
        slopes = np.nan_to_num((ahead - here) / _STEP).reshape(n, -1).T
        left = slopes @ point - np.nan_to_num(here).ravel()
        aim = slopes.T @ np.linalg.solve(slopes @ slopes.T + np.eye(len(slopes)), left)
        better = _shortened(off, point, here, aim)
        if better is None:
            break
        gain = _cost(here, point) - _cost(better[1], better[0])
        point, here = better
        if gain < _GAIN:
            break
    return point


def _shortened(
    off: Callable[[FloatArray], FloatArray], point: FloatArray, here: FloatArray, aim: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Return where on the way to an aim (D,) it is better, and what is off there; None nowhere."""
    share = 1.0
    for _ in range(_SHORTENINGS):
        moved = point + share * (aim - point)
        there = off(moved[None])[0]
        if _cost(there, moved) < _cost(here, point):
            return moved, there
        share *= _SHORTER
    return None


def _cost(off: FloatArray, point: FloatArray) -> float:
    """Return minus twice the logarithm of the posterior density."""
    farthest = _FARTHEST_M / _LANDING_M
    known = np.clip(np.nan_to_num(off, nan=farthest), -farthest, farthest)
    return float((known**2).sum() + point @ point)
