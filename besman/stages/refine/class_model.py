"""What all motions of a class learn from one of them: where to begin, and the Jacobian there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.exceptions import RunError
from besman.io.atomic_files import write_record
from besman.records import Record, freeze
from besman.records.files import load_record
from besman.search.two_level import fit_slopes, two_level_design
from besman.work.work import Work

FloatArray = npt.NDArray[np.float64]

# An outcome that moves less than this, in radii per unit, is not moved.
_LEAST_SLOPE = 0.05
# Two slopes of a coordinate that are this far apart halve the square of what it is trusted with.
_KINK = 1.0
# From so many columns processes are sooner done than threads.
_COLUMNS = 8


@dataclass(frozen=True, eq=False)
class ClassModel(
    Record,
    stored_as="besman.stages.refine.class_model:ClassModel",
    finite=("point", "jacobian", "trust"),
    later=("gained",),
):
    """What the motions of a class share, in the coordinates that a search has.

    Attributes
    ----------
    name : str
        The motion in the middle of the class, which it comes from.
    point : array, shape (D,)
        Where its outcome was good: the others begin there if nothing comes of their imitation, if
        they are searched in perturbed models, or if that is nearer, as far as is known.
    jacobian : array, shape (W, R, D)
        Of the residuals there in W worlds, in radii of success per unit.
    trust : array, shape (D,)
        How far steps may use each coordinate, 0 to 1; see `trust_of`.
    simulations : int
        How many it took.
    useless : str
        Why there is nothing to share; "" if there is.
    gained : array, shape (R,)
        By what its residual at the point differs from that of its imitation; NaN if not known.
    """

    name: str
    point: FloatArray
    jacobian: FloatArray
    trust: FloatArray
    simulations: int
    useless: str = ""
    gained: FloatArray = field(default_factory=lambda: np.full(1, np.nan))

    def __post_init__(self) -> None:
        """Copy the arrays, make them read-only and check their shapes."""
        freeze(
            self, {"point": ("D",), "jacobian": ("W", "R", "D"), "trust": ("D",), "gained": ("G",)}
        )


def nothing_shared(name: str, dimension: int, simulations: int, why: str) -> ClassModel:
    """Return the model of a class that has nothing to share."""
    nothing = np.empty((0, 0, dimension))
    return ClassModel(name, np.zeros(dimension), nothing, np.ones(dimension), simulations, why)


def trust_of(ahead: FloatArray, behind: FloatArray) -> FloatArray:
    """Return how far the slopes of coordinates can be relied on.

    An arm at its limits slows down for any change that asks more of a joint: the outcome has a kink
    there, and a slope measured on one side is worth nothing on the other.

    Parameters
    ----------
    ahead, behind : array, shape (R, D)
        Jacobians of finite differences to both sides, in radii of success per unit.

    Returns
    -------
    array, shape (D,)
        1 where they are the same, falling to 0 with how far they are apart.
    """
    apart = np.linalg.norm(ahead - behind, axis=0)
    return np.asarray(1.0 / np.sqrt(1.0 + np.square(apart / _KINK)))


def moves_too_little(jacobian: FloatArray) -> str:
    """Say what is wrong with a Jacobian (W, R, D) whose steps cannot reach a target; or ""."""
    middle = jacobian.mean(axis=0)
    rank = int(np.linalg.matrix_rank(middle, tol=_LEAST_SLOPE))
    wanted = len(middle)
    return "" if rank == wanted else f"the outcome's Jacobian is of rank {rank}, expected {wanted}"


Evaluate = Callable[[FloatArray, bool], FloatArray]
"""Gives the residuals (W, R) at a point (D,), NaN where there is none: in all worlds, or the first
alone."""


def measure_jacobian(
    evaluate: Evaluate,
    point: FloatArray,
    measured: Sequence[int],
    step: float,
    aiming: float,
    floor: FloatArray | None = None,
    work: Work = Work(),
) -> tuple[FloatArray, FloatArray]:
    """Measure a Jacobian by finite differences, forward where that way leads to an outcome.

    Parameters
    ----------
    evaluate : callable
        Found by its name in other processes.
    point : array, shape (D,)
    measured : sequence of int
        Coordinates; the others are left at 0, so that nothing moves along them.
    step : float
        Long enough to stand out of what contacts make of small changes.
    aiming : float
        Where to aim is told by differences of this to both sides in the first world: the mean of
        these takes the place of that world's slopes, and what others differ by is added.
    floor : array, shape (D,), optional
        Nothing changes below; a coordinate that is there is looked at from above alone.
    work : Work
        Threads, processes and progress.

    Returns
    -------
    jacobian : array, shape (W, R, D)
        0 where neither way has an outcome.
    trust : array, shape (D,)
        See `trust_of`.
    """
    least = np.full(len(point), -np.inf) if floor is None else floor
    look = partial(
        _look_beside, evaluate=evaluate, point=point, step=step, aiming=aiming, floor=least
    )
    # The point itself is looked at beside the others: all at once.
    (here, _), *columns = work.map(
        look, [None, *measured], name=lambda at: f"coordinate {at}", processes=_COLUMNS
    )
    jacobian, trust = np.zeros((*here.shape, len(point))), np.ones(len(point))
    for at, (found, ways) in zip(measured, columns, strict=True):
        column, ahead, behind = (
            np.nan_to_num((value - here[: len(value)]) / way)
            for value, way in zip(found, ways, strict=True)
        )
        jacobian[..., at] = column + 0.5 * (ahead[0] + behind[0]) - column[0]
        trust[at] = trust_of(ahead[0, :, None], behind[0, :, None])[0]
    return jacobian, trust


def _look_beside(
    at: int | None,
    evaluate: Evaluate,
    point: FloatArray,
    step: float,
    aiming: float,
    floor: FloatArray,
) -> tuple[Any, Any]:
    """Look at the residuals beside a point along a coordinate, or at the point itself.

    Returns
    -------
    found : tuple of array, shape (W, R)
        A step ahead, and ahead and behind by `aiming` in the first world, (1, R); of no
        coordinate, the residuals at the point.
    ways : tuple of array
        How far away each of these numbers is from: the other way where one has no outcome.
    """
    if at is None:
        return evaluate(point, True), None

    def one_way(way: float, all_worlds: bool) -> tuple[FloatArray, FloatArray]:
        found = evaluate(_moved(point, at, way), all_worlds)
        lost = np.isnan(found)
        if lost.any():
            found = np.where(lost, evaluate(_moved(point, at, -way), all_worlds), found)
        return found, np.where(lost, -way, way)

    looks = [one_way(step, True), one_way(aiming, False)]
    # Nothing changes below the floor.
    below = point[at] - aiming < floor[at]
    looks.append(looks[1] if below else one_way(-aiming, False))
    found, ways = zip(*looks, strict=True)
    return found, ways


def _moved(point: FloatArray, at: int, way: float) -> FloatArray:
    """Return a point that is moved along a coordinate."""
    moved = point.copy()
    moved[at] += way
    return moved


def measure_all_at_once(
    evaluate: Evaluate,
    point: FloatArray,
    measured: Sequence[int],
    step: float,
    floor: FloatArray | None = None,
    work: Work = Work(),
) -> FloatArray:
    """Measure the Jacobian in the model as it is by a two-level design.

    Parameters
    ----------
    evaluate, point, measured, floor, work
        As in `measure_jacobian`.
    step : float
        To either side; half of it, one way, of a coordinate that is at its floor.

    Returns
    -------
    array, shape (1, R, D)
    """
    signs = two_level_design(len(measured))
    low = np.zeros(len(point), dtype=np.bool_) if floor is None else point - step < floor
    least = point if floor is None else np.maximum(point, floor)
    ways = np.zeros((len(signs), len(point)))
    ways[:, measured] = signs * np.where(low, 0.5 * step, step)[measured]
    shift = np.zeros(len(point))
    shift[measured] = np.where(low, least - point + 0.5 * step, 0.0)[measured]
    measure = partial(_first_of, evaluate=evaluate)
    found = work.map(measure, list(point + shift + ways), name=lambda at: "a try")
    return fit_slopes(ways, np.array(found))[None]


def _first_of(point: FloatArray, evaluate: Evaluate) -> FloatArray:
    return np.asarray(evaluate(point, False)[0])


def load_class(folder: Path | None, name: str) -> ClassModel | None:
    """Return what a search before this one has kept of a class; None if nothing, or damaged."""
    if folder is None or not (folder / f"{name}.npz").is_file():
        return None
    try:
        found = load_record(folder / f"{name}.npz")
    except RunError:
        return None
    return found if isinstance(found, ClassModel) else None


def keep_class(folder: Path | None, name: str, model: ClassModel) -> None:
    """Keep the model of a class for a search that goes on where this one was ended."""
    if folder is not None and folder.is_dir():
        write_record(folder / f"{name}.npz", model, durable=False)
