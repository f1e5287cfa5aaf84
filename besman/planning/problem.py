"""Goals and a start, held against what was learnt: a problem for the search, or what is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError, nearest
from besman.planning.goals import Goal, Standing
from besman.planning.learnt import Learnt
from besman.planning.order_search import Condition, Order, OrderProblem, fulfils

FloatArray = npt.NDArray[np.float64]

# Of those that were shown at a place so many are tried where a goal leaves it open.
_MOST_POSES = 3


Wanted = dict[int, tuple[Standing, frozenset[int]]]
"""What an object, by its index, was last asked to do, and the spots at which it does."""


@dataclass(frozen=True, eq=False)
class Spot:
    """Where an object may stand.

    Attributes
    ----------
    place : int
    poses : tuple of array, shape (7,)
        Of its middle, in the world; more than one where a goal leaves something open: the heading
        (turned about the arm as the place is, and as shown), or all (as in several demonstrations).
    """

    place: int
    poses: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class Posed:
    """A problem, and what its numbers mean.

    Attributes
    ----------
    problem : OrderProblem
    things : tuple of str, length O
    spots : tuple of Spot
    goals : tuple of Goal
    """

    problem: OrderProblem
    things: tuple[str, ...]
    spots: tuple[Spot, ...]
    goals: tuple[Goal, ...]


def pose_problem(goals: tuple[Goal, ...], start: tuple[Standing, ...], learnt: Learnt) -> Posed:
    """Make a problem of goals and a start.

    A goal that was reached is kept by those after it that name other objects.

    Parameters
    ----------
    goals : tuple of Goal
    start : tuple of Standing
        Where objects stand; none: the first of what was shown, where it was shown first.
    learnt : Learnt

    Raises
    ------
    PlanError
        If an object, a place or a block is not there, or two objects would stand in one another.
    """
    kind, place = learnt.first
    start = start or (Standing(f"{kind}1", learnt.places[place].name),)
    things = tuple(one.thing for one in start)
    kinds = tuple(_kind(thing, learnt) for thing in things)
    for one in (one for goal in goals for one in goal):
        _check_thing(one.thing, things, learnt)
    spots: list[Spot] = []
    stand = [_add(spots, _spot(one, things, learnt, one_way=True)) for one in start]
    for at, known in enumerate(learnt.places):
        _add(spots, Spot(at, tuple(known.poses[:_MOST_POSES])))
    asked = {
        one: _add(spots, _spot(one, things, learnt))
        for goal in goals
        for one in goal
        if one.at is not None
    }
    free = _find_free(spots, learnt.bench.task.box.size_m)
    wanted: Wanted = {
        thing: (one, frozenset({spot}))
        for thing, (one, spot) in enumerate(zip(start, stand, strict=True))
    }
    _refuse_overlap(wanted, free, "the start: ")
    conditions: list[tuple[Condition, ...]] = []
    for goal in goals:
        for one in goal:
            place = _place(one, things, learnt)
            anywhere = frozenset(k for k, spot in enumerate(spots) if spot.place == place)
            named = frozenset({asked[one]}) if one in asked else anywhere
            wanted[things.index(one.thing)] = (one, named)
        _refuse_overlap(wanted, free, "")
        conditions.append(tuple((thing, spot) for thing, (_, spot) in sorted(wanted.items())))
    problem = OrderProblem(
        blocks=learnt.blocks,
        kinds=kinds,
        start=tuple(stand),
        spots=tuple(spot.place for spot in spots),
        free=free,
        goals=tuple(conditions),
        ends=learnt.ends,
        shown=learnt.shown,
    )
    return Posed(problem, things, tuple(spots), goals)


def _kind(thing: str, learnt: Learnt) -> str:
    """Return the kind of an object: its name without its number."""
    kind = thing.rstrip("0123456789")
    if kind not in learnt.kinds:
        raise PlanError(f"no object {thing!r:.80}; {nearest(kind, learnt.kinds)}, with a number")
    return kind


def _check_thing(thing: str, things: tuple[str, ...], learnt: Learnt) -> None:
    """Refuse an object that is not there."""
    if thing not in things:
        _kind(thing, learnt)
        raise PlanError(
            f"no object {thing!r:.80}; {nearest(thing, things)}; where others stand is said by "
            f"--start '{'; '.join(f'{one} on PLACE' for one in (*things, thing))}'"
        )


def _place(one: Standing, things: tuple[str, ...], learnt: Learnt) -> int:
    """Return the index of a place."""
    names = [place.name for place in learnt.places]
    if one.place in names:
        return names.index(one.place)
    if one.place in things:
        raise PlanError(
            f"{one}: nobody has shown how to put something on top of {one.place}; places: "
            f"{', '.join(names)}"
        )
    raise PlanError(
        f"{one}: no place {one.place!r:.80}; {nearest(one.place, names)}; a run knows the places "
        "of its actions (select.action)"
    )


def _spot(one: Standing, things: tuple[str, ...], learnt: Learnt, one_way: bool = False) -> Spot:
    """Return where something stands; a heading that is open is as shown, or turned to the arm."""
    place = _place(one, things, learnt)
    shown = learnt.places[place].pose
    if one.at is None:
        return Spot(place, (shown,))
    heading = 2.0 * np.arctan2(shown[6], shown[3])
    turned = np.arctan2(one.at[1], one.at[0]) - np.arctan2(shown[1], shown[0])
    # Turned about the arm with its place, the arm does there what it was shown to.
    headings = [heading + turned, heading]
    if one.yaw_deg is not None:
        headings = [np.radians(one.yaw_deg)]
    elif one_way:
        headings = [heading]
    return Spot(
        place,
        tuple(
            np.array([*one.at, shown[2], np.cos(half), 0.0, 0.0, np.sin(half)])
            for half in (0.5 * angle for angle in headings)
        ),
    )


def _add(spots: list[Spot], spot: Spot) -> int:
    """Add a spot that is not there yet; return its index."""
    for at, other in enumerate(spots):
        if other.place == spot.place and np.array_equal(other.poses[0], spot.poses[0]):
            spots[at] = max(spot, other, key=lambda one: len(one.poses))
            return at
    spots.append(spot)
    return len(spots) - 1


def _find_free(spots: Sequence[Spot], size_m: Sequence[float]) -> npt.NDArray[np.bool_]:
    """Tell for two spots whether boxes at both are apart, however they are turned."""
    middles = np.stack([spot.poses[0][:3] for spot in spots])
    apart = np.abs(middles[:, None] - middles[None])
    beside = np.hypot(apart[..., 0], apart[..., 1]) >= np.hypot(size_m[0], size_m[1])
    return np.asarray(beside | (apart[..., 2] >= size_m[2]))


def _refuse_overlap(
    wanted: Wanted,
    free: npt.NDArray[np.bool_],
    where: str,
) -> None:
    """Refuse objects that would stand on or in one another."""
    known = [wanted[thing] for thing in sorted(wanted)]
    for number, (one, own) in enumerate(known):
        for other, others in known[:number]:
            if not any(free[a, b] for a in own for b in others):
                raise PlanError(
                    f"{where}{one}: {other.thing} stands there ({other}); expected a place beside "
                    "it: at x=METRES,y=METRES"
                )


def explain_no_order(posed: Posed, order: Order, learnt: Learnt) -> str:
    """Say why there is no order of blocks for the first goal that is not reached.

    Parameters
    ----------
    posed : Posed
    order : Order
        What the search says.
    learnt : Learnt
    """
    problem, names = posed.problem, [place.name for place in learnt.places]
    if order.n_done == len(posed.goals):
        return "all goals can be reached, but no block brings the hand back to rest"
    goal = posed.goals[order.n_done]
    told = " and ".join(map(str, goal))
    for one in goal:
        kind = _kind(one.thing, learnt)
        put = {b.place for b in learnt.blocks if b.frame == "target" and b.thing == kind}
        if names.index(one.place) not in put:
            return (
                f"{told}: no block puts a {kind} on {one.place}; blocks put it on: "
                f"{', '.join(names[at] for at in sorted(put))} (select.action of the run may name "
                "several actions)"
            )
    taken = {b.place for b in learnt.blocks if b.frame == "object"}
    stood = {problem.spots[spot] for spot in problem.start}
    stood |= {names.index(one.place) for goal in posed.goals[: order.n_done] for one in goal}
    stuck = sorted(names[at] for at in stood - taken)
    if stuck:
        return (
            f"{told}: no block takes something from {', '.join(stuck)}; blocks take it from: "
            f"{', '.join(names[at] for at in sorted(taken))} (select.action of the run may name "
            "several actions)"
        )
    return f"{told}: no order of {', '.join(sorted({b.label for b in learnt.blocks}))} leads there"


def holds_already(posed: Posed) -> bool:
    """Tell whether every goal holds before anything was done."""
    return all(fulfils(goal, posed.problem.start) for goal in posed.problem.goals)
