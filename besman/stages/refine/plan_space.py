"""The motion plans around one: what a search may change, in comparable units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from besman.geometry.quaternions import (
    conjugate,
    from_rotation_vector,
    multiply,
    rotation_vector,
)
from besman.motion.cartesian_dmp import move_ends, pose_coordinates, roll_out_poses
from besman.motion.dmp import respond, roll_out
from besman.motion.dmp_fit import goal_response, shape_directions
from besman.motion.rollout import least_duration, roll_out_plans, stretch_plan
from besman.records import AnyPlan, CartesianPlan, MotionPlan, Record
from besman.robot.model import Robot
from besman.robot.parts import JointLimits
from besman.search.protocol import Part

FloatArray = npt.NDArray[np.float64]

_GREATEST_STRETCH = 3.0
_HALVINGS = 8
# Places of a movement that are compared with the limits of position: every so manieth node.
_LIMIT_STRIDE = 5
_LIMIT_MARGIN_RAD = 0.002
# Places at which the paths of two movements are compared.
_N_PLACES = 101


@dataclass(frozen=True)
class Units(Record, stored_as="besman.refinement.plan_space:Units"):
    """What one unit of the search changes.

    Attributes
    ----------
    start_rad, start_m, goal_rad, goal_m : float
        Start and goal of a joint, or of the tool's rotation; of the tool's position.
    log_duration : float
        Natural logarithm of the duration.
    shape_rad, shape_m : float
        Root mean square over the movement by which the smoothest change of a joint's weights (of
        the weights of a coordinate of the tool's rotation, of its position) moves that joint;
        rougher ones move it less, with the same acceleration.
    """

    start_rad: float = 0.1
    goal_rad: float = 0.1
    log_duration: float = 0.1
    shape_rad: float = 0.1
    start_m: float = 0.03
    goal_m: float = 0.03
    shape_m: float = 0.03


class Space(Protocol):
    """Motion plans by the points of a vector space; the first plan is its origin."""

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        ...

    def plan_at(self, point: npt.ArrayLike) -> AnyPlan:
        """Return the motion plan at a point, shape (D,)."""
        ...

    def coordinates(self, parts: Sequence[Part]) -> list[int]:
        """Return which coordinates belong to some parts."""
        ...

    def project(self, plan: AnyPlan) -> FloatArray:
        """Return the point (D,) whose plan is like another of its kind, as far as one can be."""
        ...

    @property
    def floor(self) -> FloatArray:
        """Coordinates, shape (D,), below which nothing changes."""
        ...


class PlanSpace:
    """Motion plans that differ from a first one in start, goal, duration and weights.

    Every plan starts and ends at rest, and lasts as long as the arm's limits of velocity and
    acceleration require. Another duration is another speed, evenly, also at the goal.

    Parameters
    ----------
    plan : MotionPlan
        The origin.
    limits : JointLimits
        Of the arm.
    parts : tuple of "start", "goal", "duration", "weights"
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
        # A goal that is passed moves its quintic; one that is rested at asks it of the weights.
        self._goal_response = goal_response(n_weights) * float(plan.kind == "joint_dmp")
        self._shapes = shape_directions(n_weights)[:n_shapes]
        sizes = {"start": n, "goal": n, "duration": 1, "weights": n * len(self._shapes)}
        self._sizes = [sizes[part] for part in parts]

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return sum(self._sizes)

    def plan_at(self, point: npt.ArrayLike) -> MotionPlan:
        """Return the motion plan at a point, shape (D,)."""
        start, n = self._plan, len(self._plan.goal)
        pieces = _split(point, self._parts, self._sizes)
        weights, first, goal = start.weights, start.start, start.goal
        if "start" in pieces:
            # All of the movement goes along with its start, and the goal comes back.
            moved = self._units.start_rad * pieces["start"]
            first = first + moved
            weights = weights - np.outer(moved, self._goal_response)
        if "goal" in pieces:
            moved = self._units.goal_rad * pieces["goal"]
            goal = goal + moved
            weights = weights + np.outer(moved, self._goal_response)
        if "weights" in pieces:
            shape = self._units.shape_rad * pieces["weights"].reshape(n, -1)
            weights = weights + shape @ self._shapes
        if np.any(point) and start.kind == "joint_dmp":
            weights, first, goal = self._keep_within_limits(weights, first, goal)
        plan = replace(start, weights=weights, start=first, goal=goal)
        least = least_duration(plan, self._limits)
        return stretch_plan(plan, _duration(start.duration, least, pieces, self._units))

    @property
    def floor(self) -> FloatArray:
        """Coordinates, shape (D,), below which nothing changes: nothing is faster than it may."""
        least = least_duration(self._plan, self._limits) / self._plan.duration
        return _floor(least, self._parts, self._sizes, self._units)

    def project(self, plan: AnyPlan) -> FloatArray:
        """Return the point (D,) whose plan is like another in start, goal, duration and path."""
        assert isinstance(plan, MotionPlan)
        mine, units, found = self._plan, self._units, dict[Part, FloatArray]()
        weights, start, goal = mine.weights, mine.start, mine.goal
        if "start" in self._parts:
            found["start"] = (plan.start - start) / units.start_rad
            weights = weights - np.outer(plan.start - start, self._goal_response)
            start = plan.start
        if "goal" in self._parts:
            found["goal"] = (plan.goal - goal) / units.goal_rad
            weights = weights + np.outer(plan.goal - goal, self._goal_response)
            goal = plan.goal
        moved = replace(mine, weights=weights, start=start, goal=goal)
        path = _path_of(moved)
        ways = [_path_of(replace(moved, weights=weights + one)) - path for one in self._shapes]
        responses = np.array([way[:, 0] for way in ways]).T
        shape = np.linalg.lstsq(responses, _path_of(plan) - path, rcond=None)[0].T
        found["weights"] = shape.ravel() / units.shape_rad
        if "weights" in self._parts:
            moved = replace(moved, weights=weights + shape @ self._shapes)
        least = least_duration(moved, self._limits)
        found["duration"] = _asked(plan.duration, mine.duration, least, units)
        return np.concatenate([found[part] for part in self._parts])

    def coordinates(self, parts: Sequence[Part]) -> list[int]:
        """Return which coordinates belong to some parts."""
        return _coordinates(self._parts, self._sizes, parts)

    def _keep_within_limits(
        self, weights: FloatArray, first: FloatArray, goal: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Move a joint's movement back to where it leaves its limits least.

        All of it, if the start may change; its end, if only the goal may. Episodes that say no more
        than that a joint went too far are most of those of an arm that works near its limits.
        """
        if not {"start", "goal"} & set(self._parts):
            return weights, first, goal
        path = respond(np.column_stack([first, goal, weights]).T)[0][::_LIMIT_STRIDE]
        room = _LIMIT_MARGIN_RAD
        below = np.maximum(self._limits.position_min + room - path.min(axis=0), 0.0)
        above = np.maximum(path.max(axis=0) - self._limits.position_max + room, 0.0)
        back = np.where((below > 0) & (above > 0), 0.0, below - above)
        if "start" in self._parts:
            return weights, first + back, goal + back
        return weights + np.outer(back, self._goal_response), first, goal + back


class CartesianPlanSpace:
    """Cartesian plans that differ from a first one in start, goal pose, duration and weights.

    Every plan starts and ends at rest, and lasts as long as the limits of velocity and
    acceleration require of the joint movement that inverse kinematics gives. Where the pose makes
    the arm jump, that is long: a point whose plan would need three times the time of the first
    one stands for the point halfway to the origin, and so on.

    Parameters
    ----------
    plan : CartesianPlan
        The origin.
    robot : Robot
        The arm with its tool.
    parts : tuple of "start", "goal", "duration", "weights"
        What may change.
    n_shapes : int
        How many changes of the weights per coordinate, the smoothest first.
    units : Units
        What one unit is.
    """

    def __init__(
        self,
        plan: CartesianPlan,
        robot: Robot,
        parts: tuple[Part, ...],
        n_shapes: int,
        units: Units = Units(),
    ) -> None:
        self._plan, self._robot, self._parts, self._units = plan, robot, parts, units
        self._shapes = shape_directions(plan.weights.shape[1])[:n_shapes]
        self._least_s = least_duration(plan, robot.limits, robot)
        self._greatest_s = _GREATEST_STRETCH * max(plan.duration, self._least_s)
        sizes = {"start": 6, "goal": 6, "duration": 1, "weights": 6 * len(self._shapes)}
        self._sizes = [sizes[part] for part in parts]

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return sum(self._sizes)

    def plan_at(self, point: npt.ArrayLike) -> CartesianPlan:
        """Return the motion plan at a point, shape (D,)."""
        point = np.asarray(point, dtype=np.float64)
        for _ in range(_HALVINGS):
            plan, pieces = self._plan_at(point)
            least = least_duration(plan, self._robot.limits, self._robot)
            if least <= self._greatest_s:
                duration = _duration(plan.duration, least, pieces, self._units)
                return replace(plan, duration=duration)
            point = 0.5 * point
        return replace(self._plan, duration=max(self._plan.duration, self._least_s))

    def coordinates(self, parts: Sequence[Part]) -> list[int]:
        """Return which coordinates belong to some parts."""
        return _coordinates(self._parts, self._sizes, parts)

    def project(self, plan: AnyPlan) -> FloatArray:
        """Return the point (D,) whose plan is like another in start, goal, duration and path."""
        assert isinstance(plan, CartesianPlan)
        mine, units, found = self._plan, self._units, dict[Part, FloatArray]()
        start = plan.start if "start" in self._parts else mine.start
        goal = plan.goal if "goal" in self._parts else mine.goal
        scale = np.repeat([units.shape_m, units.shape_rad], 3)[:, None]
        found["start"] = _pose_change(start, mine.start, units.start_m, units.start_rad)
        found["goal"] = _pose_change(goal, mine.goal, units.goal_m, units.goal_rad)
        weights = move_ends(mine.weights, (mine.start, mine.goal), (start, goal))
        x, nothing = np.linspace(0.0, 1.0, _N_PLACES), np.zeros(len(self._shapes))
        path, other = (
            pose_coordinates(roll_out_poses(*movement, 1.0, x), goal)
            for movement in ((weights, start, goal), (plan.weights, plan.start, plan.goal))
        )
        responses = roll_out(self._shapes, nothing, nothing, 1.0, x)[0]
        shape = np.linalg.lstsq(responses, other - path, rcond=None)[0].T
        found["weights"] = (shape / scale).ravel()
        moved = replace(mine, weights=weights, start=start, goal=goal)
        if "weights" in self._parts:
            moved = replace(moved, weights=weights + shape @ self._shapes)
        least = least_duration(moved, self._robot.limits, self._robot)
        found["duration"] = _asked(plan.duration, mine.duration, least, units)
        return np.concatenate([found[part] for part in self._parts])

    @property
    def floor(self) -> FloatArray:
        """Coordinates, shape (D,), below which nothing changes: nothing is faster than it may."""
        return _floor(self._least_s / self._plan.duration, self._parts, self._sizes, self._units)

    def _plan_at(self, point: FloatArray) -> tuple[CartesianPlan, dict[Part, FloatArray]]:
        """Return the plan at a point, whatever its joint movement, and the point's parts."""
        start, units = self._plan, self._units
        pieces = _split(point, self._parts, self._sizes)
        weights, first, goal = start.weights, start.start, start.goal
        if "start" in pieces:
            first = _move_pose(first, pieces["start"], units.start_m, units.start_rad)
        if "goal" in pieces:
            goal = _move_pose(goal, pieces["goal"], units.goal_m, units.goal_rad)
        if "start" in pieces or "goal" in pieces:
            weights = move_ends(weights, (start.start, start.goal), (first, goal))
        if "weights" in pieces:
            scale = np.repeat([units.shape_m, units.shape_rad], 3)[:, None]
            weights = weights + (scale * pieces["weights"].reshape(6, -1)) @ self._shapes
        return replace(start, weights=weights, start=first, goal=goal), pieces


def plan_space(
    plan: AnyPlan, robot: Robot, parts: tuple[Part, ...], n_shapes: int, units: Units = Units()
) -> Space:
    """Set up the space of the plans around one, see `PlanSpace` and `CartesianPlanSpace`."""
    if isinstance(plan, CartesianPlan):
        return CartesianPlanSpace(plan, robot, parts, n_shapes, units)
    return PlanSpace(plan, robot.limits, parts, n_shapes, units)


def _move_pose(pose: FloatArray, change: FloatArray, metres: float, radians: float) -> FloatArray:
    """Move a pose (7,) by a change (6,) of its position and orientation, in these units."""
    turned = from_rotation_vector(radians * change[3:])
    return np.concatenate([pose[:3] + metres * change[:3], multiply(turned, pose[3:])])


def _pose_change(pose: FloatArray, before: FloatArray, metres: float, radians: float) -> FloatArray:
    """Return the change (6,), in these units, that moves one pose (7,) to another."""
    turned = rotation_vector(multiply(pose[3:], conjugate(before[3:])))
    return np.concatenate([(pose[:3] - before[:3]) / metres, turned / radians])


def _path_of(plan: MotionPlan) -> FloatArray:
    """Return the joints (T, n), rad, at equal shares of a plan's duration."""
    return np.asarray(roll_out_plans([plan], np.linspace(0.0, plan.duration, _N_PLACES))[0][0])


def _asked(wanted: float, duration: float, least: float, units: Units) -> FloatArray:
    """Return what makes `_duration` give the wanted one, shape (1,), in units of the search."""
    longer = max(np.log(wanted / max(duration, least)), 0.0)
    shorter = min(np.log(max(wanted, least) / duration), 0.0)
    return np.array([(longer + shorter) / units.log_duration])


def _split(
    point: npt.ArrayLike, parts: tuple[Part, ...], sizes: Sequence[int]
) -> dict[Part, FloatArray]:
    """Cut a point into its parts."""
    ends = np.cumsum(sizes)[:-1]
    return dict(zip(parts, np.split(np.asarray(point, dtype=np.float64), ends), strict=True))


def _coordinates(parts: Sequence[Part], sizes: Sequence[int], some: Sequence[Part]) -> list[int]:
    """Return the places of some of the parts in a point."""
    owners = [part for part, size in zip(parts, sizes, strict=True) for _ in range(size)]
    return [at for at, owner in enumerate(owners) if owner in some]


def _duration(duration: float, least: float, pieces: dict[Part, FloatArray], units: Units) -> float:
    """Return the duration that a point asks for, seconds.

    What is slowed down is slower than what the limits allow, however far they have slowed it down
    already: a search along it finds no place from which on it begins to matter.
    """
    asked = pieces["duration"][0] if "duration" in pieces else 0.0
    # Bounded, because nothing is learnt from movements of a minute or a millisecond.
    stretch = float(np.clip(units.log_duration * asked, -2.0, 2.0))
    shortest = max(duration * float(np.exp(min(stretch, 0.0))), least)
    return shortest * float(np.exp(max(stretch, 0.0)))


def _floor(least: float, parts: Sequence[Part], sizes: Sequence[int], units: Units) -> FloatArray:
    """Return below which coordinates nothing changes; `least` is relative to the duration."""
    floor = np.full(sum(sizes), -np.inf)
    floor[_coordinates(parts, sizes, ("duration",))] = min(np.log(least), 0.0) / units.log_duration
    return floor
