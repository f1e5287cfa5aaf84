"""One placement of all demonstrations of a class in the workspace of an arm, or of two arms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, fields

import numpy as np
import numpy.typing as npt

from besman.robot.inverse_kinematics import IkWeights
from besman.robot.model import Robot
from besman.search.in_a_box import BoxSearch, Optimizer, make_box_search
from besman.stages.map.placement_cost import (
    ArmCost,
    ArmPaths,
    Cost,
    pose_of,
    scale_about,
    thin_rows,
)
from besman.stages.map.terms import TermWeights

FloatArray = npt.NDArray[np.float64]

# A unit of the search: metres along x, y, z, radians of yaw, natural logarithm of the scale.
_UNITS = np.array([0.1, 0.1, 0.1, 0.3, 0.1])
# Shares of the arm's length: in front of the base, to its left, above its shoulder.
_GRID_FORWARD = (-0.3, 0.0, 0.3, 0.55)
_GRID_LEFT = (-0.7, -0.35, 0.0, 0.35, 0.7)
_GRID_UP = (0.0, 0.25, 0.5, 0.75)
_GRID_YAW_RAD = tuple(np.pi / 4 * np.arange(-3, 5))
# So many of the grid's places are worth more than a glance.
_LOOKED_AT = 96
# Several starts of the grid are followed for a while, the best of them to the end.
_RACERS = 5
_APART = 3.0  # units of the search between two starts
_RACE_SHARE = 0.25
# The box, in lengths of the arm around its shoulder; a turn and a half, so that no end is near.
_BOX_REACH = 1.3
_BOX_YAW_RAD = 1.5 * np.pi
# One demonstration's own placement: an evaluation's share, and what 10 cm or 0.3 rad cost.
_SHIFT_COST = 0.3


@dataclass(frozen=True)
class PlacementSearch:
    """How a placement is looked for.

    Attributes
    ----------
    weights : TermWeights
        What a good placement is.
    ik : IkWeights
        Position before orientation.
    free_spin : bool
        The rotation about the tool's axis does not matter.
    optimizer : "cma_es" or "differential_evolution"
    evaluations : int
        Placements to try after a coarse grid.
    yaw : bool
        Demonstrations may be turned about the vertical.
    scale : pair of float, optional
        Least and greatest factor by which movements may be made smaller or larger.
    demonstrations : int
        Of more demonstrations than this, as many are looked at, evenly spaced in their order.
    seed : int
        Of the search and of the configurations it starts from.
    """

    weights: TermWeights = field(default_factory=TermWeights)
    ik: IkWeights = field(default_factory=IkWeights)
    free_spin: bool = False
    optimizer: Optimizer = "cma_es"
    evaluations: int = 200
    yaw: bool = True
    scale: tuple[float, float] | None = None
    demonstrations: int = 64
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Placement:
    """Where the demonstrations go.

    Attributes
    ----------
    pose : array, shape (4, 4)
        Back frame to the robot's world frame: translation and yaw, metres.
    centre : array, shape (3,)
        Point of the back frame, metres, about which movements are scaled.
    scale : float
        Factor by which they are made smaller or larger before.
    terms : dict of float
        Mean of every term over the demonstrations, unweighted.
    cost : float
        Their weighted sum.
    evaluations : int
        Placements tried after the coarse grid.
    """

    pose: FloatArray
    centre: FloatArray
    scale: float
    terms: dict[str, float]
    cost: float
    evaluations: int

    @property
    def yaw(self) -> float:
        """Rotation about the vertical, rad."""
        return float(np.arctan2(self.pose[1, 0], self.pose[0, 0]))

    def apply(self, poses: FloatArray) -> FloatArray:
        """Bring poses (..., 4, 4) of the back frame, metres, into the robot's world."""
        placed: FloatArray = self.pose @ scale_about(poses, self.centre, self.scale)
        return placed


def find_placement(
    arms: Sequence[ArmPaths],
    search: PlacementSearch,
    *,
    back_height: float | None = None,
    jobs: int = 1,
    progress: Callable[[float], None] = lambda done: None,
) -> Placement:
    """Choose where in the robot's world the demonstrations are.

    A coarse grid of positions and yaws comes first. A black-box search then starts from its best
    places, and goes on from the one that was best for a while.

    Parameters
    ----------
    arms : sequence of ArmPaths
        One arm, or several with one world, for which one placement is chosen.
    search : PlacementSearch
    back_height : float, optional
        Height of the back frame's origin above the floor in the demonstrations, metres.
    jobs : int
        Threads; does not change the result.
    progress : callable
        Called with the share done.

    Returns
    -------
    Placement
    """
    chosen = [_choose(arm, search.demonstrations) for arm in arms]
    points = [poses[thin_rows(len(time)), :3, 3] for arm in chosen for time, poses in arm.paths]
    centre = np.concatenate(points).mean(0)
    costs = tuple(_cost(arm, search, centre, back_height) for arm in chosen)
    space = _Space.around(arms[0].robot, search)
    with ThreadPoolExecutor(max_workers=jobs) as threads:
        grid, cost = _search_grid(Cost(costs), space, threads)
        progress(0.3)
        point, tried = _race(
            grid, cost, space, search, threads, lambda done: progress(0.3 + 0.7 * done)
        )
    return _placement(cost, space.parameters(point), centre, tried)


def correct_placement(
    arm: ArmPaths, search: PlacementSearch, common: Placement, back_height: float | None = None
) -> Placement:
    """Move one demonstration away from the placement of its class, as little as serves it.

    Parameters
    ----------
    arm : ArmPaths
        The arm and the one demonstration.
    search : PlacementSearch
    common : Placement
        The class's.
    back_height : float, optional
        As in `find_placement`.

    Returns
    -------
    Placement
    """
    cost = _cost(arm, search, common.centre, back_height)
    space = _Space.around(arm.robot, search)
    middle = common.pose[:3, :3] @ common.centre + common.pose[:3, 3]
    origin = space.point(np.array([*middle, common.yaw, common.scale]))

    def dear(point: FloatArray) -> float:
        shift = float(np.linalg.norm(point - origin))
        return cost(space.parameters(point)) + _SHIFT_COST * shift

    strategy = make_box_search(search.optimizer, origin, space.low, space.high, search.seed)
    best, least, tried = origin, dear(origin), 1
    while tried < search.evaluations and not strategy.exhausted:
        points = strategy.ask()
        values = np.array([dear(point) for point in points])
        strategy.tell(points, values)
        tried += len(points)
        if values.min() < least:
            best, least = points[int(np.argmin(values))], float(values.min())
    strategy.close()
    return _placement(Cost((cost,)), space.parameters(best), common.centre, tried)


def _cost(
    arm: ArmPaths, search: PlacementSearch, centre: FloatArray, back_height: float | None
) -> ArmCost:
    """Return what placements cost one arm."""
    return arm.cost(centre, search.weights, search.ik, search.free_spin, search.seed, back_height)


def _placement(
    cost: Cost, parameters: FloatArray, centre: FloatArray, evaluations: int
) -> Placement:
    """Sum up."""
    terms = cost.terms(parameters)
    names = [field.name for field in fields(TermWeights)]
    if len(terms) > len(names):
        names.append("surroundings")
    return Placement(
        pose=pose_of(parameters, centre),
        centre=centre,
        scale=float(parameters[4]),
        terms=dict(zip(names, terms.tolist(), strict=True)),
        cost=float(terms @ cost.arms[0].weight_array),
        evaluations=evaluations,
    )


@dataclass(frozen=True, eq=False)
class _Space:
    """The points of a search, in its units: x, y, z, and yaw and scale where they are free.

    Attributes
    ----------
    free : bool array, shape (5,)
        Which of x, y, z (m), yaw (rad), scale are searched; the others are 0 or 1.
    low, high : array, shape (D,)
        The box.
    reach, shoulder : float
        Length of the arm and height of its first joint above the floor, metres.
    """

    free: npt.NDArray[np.bool_]
    low: FloatArray
    high: FloatArray
    reach: float
    shoulder: float

    @classmethod
    def around(cls, robot: Robot, search: PlacementSearch) -> _Space:
        """Return the space around an arm."""
        reach, shoulder = _reach(robot), float(robot.chain.placements[0, 2, 3])
        free = np.array([True, True, True, search.yaw, search.scale is not None])
        far = _BOX_REACH * reach
        least, greatest = search.scale or (1.0, 1.0)
        low = np.array([-far, -far, min(0.0, shoulder - far), -_BOX_YAW_RAD, np.log(least)])
        high = np.array([far, far, shoulder + far, _BOX_YAW_RAD, np.log(greatest)])
        return cls(free, (low / _UNITS)[free], (high / _UNITS)[free], reach, shoulder)

    def parameters(self, point: FloatArray) -> FloatArray:
        """Return x, y, z, yaw, scale of a point."""
        full = np.zeros(5)
        full[self.free] = point
        full *= _UNITS
        full[4] = np.exp(full[4])
        return full

    def point(self, parameters: FloatArray) -> FloatArray:
        """Return the point of x, y, z, yaw, scale, inside the box."""
        full = np.array([*parameters[:4], np.log(parameters[4])]) / _UNITS
        inside: FloatArray = np.clip(full[self.free], self.low, self.high)
        return inside


def _choose(arm: ArmPaths, number: int) -> ArmPaths:
    """Take at most so many demonstrations, evenly spaced in their order."""
    if len(arm.paths) <= number:
        return arm
    rows = np.rint(np.linspace(0, len(arm.paths) - 1, number)).astype(int)
    scenes = [arm.scenes[row] for row in rows] if arm.scenes else ()
    return ArmPaths(arm.robot, [arm.paths[row] for row in rows], scenes)


def _reach(robot: Robot) -> float:
    """Length of the arm from its second joint on, metres."""
    links = np.linalg.norm(robot.chain.placements[2:, :3, 3], axis=1).sum()
    return float(links + np.linalg.norm(robot.chain.tip[:3, 3]))


def _search_grid(
    cost: Cost, space: _Space, threads: ThreadPoolExecutor
) -> tuple[list[FloatArray], Cost]:
    """Find good starts on a coarse grid, and the few branches of the arm that matter there."""
    grid = [
        space.point(
            np.array(
                [
                    forward * space.reach,
                    left * space.reach,
                    space.shoulder + up * space.reach,
                    yaw,
                    1.0,
                ]
            )
        )
        for forward in _GRID_FORWARD
        for left in _GRID_LEFT
        for up in _GRID_UP
        for yaw in (_GRID_YAW_RAD if space.free[3] else (0.0,))
    ]
    grid = _sort(grid, Cost(tuple(arm.glance() for arm in cost.arms)), space, threads)
    sample = Cost(tuple(arm.sample() for arm in cost.arms))
    starts: list[FloatArray] = []
    for point in _sort(grid[:_LOOKED_AT], sample, space, threads) + grid[_LOOKED_AT:]:
        if all(np.linalg.norm(point - other) >= _APART for other in starts):
            starts.append(point)
        if len(starts) == _RACERS:
            break
    places = [space.parameters(point) for point in starts]
    return starts, Cost(tuple(arm.keep_branches(places) for arm in cost.arms))


def _sort(
    points: list[FloatArray], cost: Cost, space: _Space, threads: ThreadPoolExecutor
) -> list[FloatArray]:
    """Return points in the order of their cost."""
    costs = list(threads.map(lambda point: cost(space.parameters(point)), points))
    return [points[index] for index in np.argsort(costs, kind="stable")]


def _race(
    starts: list[FloatArray],
    cost: Cost,
    space: _Space,
    search: PlacementSearch,
    threads: ThreadPoolExecutor,
    progress: Callable[[float], None],
) -> tuple[FloatArray, int]:
    """Search from several starts for a while, then on from the best; return it and the tries."""
    if search.optimizer != "cma_es":
        # A search over the whole box has one start.
        starts = starts[:1]
    racers = [
        make_box_search(search.optimizer, start, space.low, space.high, search.seed)
        for start in starts
    ]
    found = [(np.inf, start) for start in starts]
    sample = Cost(tuple(arm.sample() for arm in cost.arms))
    tried = [0] * len(racers)
    share = int(np.ceil(_RACE_SHARE * search.evaluations)) if len(racers) > 1 else 0
    total = search.evaluations + share * (len(racers) - 1)

    def run(index: int, limit: int, cost: Cost) -> None:
        while tried[index] < limit and not racers[index].exhausted:
            points, values = _step(racers[index], cost, space, threads)
            tried[index] += len(points)
            least = int(np.argmin(values))
            if values[least] < found[index][0]:
                found[index] = (float(values[least]), points[least])
            progress(min(1.0, sum(tried) / total))

    for index in range(len(racers)):
        run(index, share, sample)
    best = min(range(len(racers)), key=lambda index: found[index][0])
    found[best] = (cost(space.parameters(found[best][1])), found[best][1])
    run(best, search.evaluations, cost)
    for racer in racers:
        racer.close()
    return found[best][1], sum(tried)


def _step(
    racer: BoxSearch, cost: Cost, space: _Space, threads: ThreadPoolExecutor
) -> tuple[FloatArray, FloatArray]:
    """Try one generation; return its points and their costs."""
    points = racer.ask()
    values = np.array(list(threads.map(lambda point: cost(space.parameters(point)), points)))
    racer.tell(points, values)
    return points, values
