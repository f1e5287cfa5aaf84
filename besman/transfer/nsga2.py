"""Multi-objective search by NSGA-II."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from besman.exceptions import TransferError, why_not_there

FloatArray = npt.NDArray[np.float64]


def nsga2(
    costs: Callable[[FloatArray], FloatArray],
    first: npt.ArrayLike,
    bounds: tuple[float, float],
    population: int,
    generations: int,
    seed: int,
) -> FloatArray:
    """Search points of which no other is better in every objective.

    Parameters
    ----------
    costs : callable
        Gives the objectives (P, K) of points (P, D), all to be made small.
    first : array, shape (F, D)
        Points to start from; those beyond the bounds are moved to them.
    bounds : pair of float
        Least and greatest value of every coordinate.
    population : int
        Points that are kept, and made anew in every generation.
    generations : int
        How many; 0 for the best of the first points.
    seed : int
        Of the search.

    Returns
    -------
    array, shape (N, D)
        The points of the last population of which no other one is better, N at most `population`.

    Raises
    ------
    TransferError
        If pymoo is not installed.

    References
    ----------
    .. [1] K. Deb, A. Pratap, S. Agarwal, T. Meyarivan: A fast and elitist multiobjective genetic
       algorithm: NSGA-II, IEEE Transactions on Evolutionary Computation 6(2), 2002,
       DOI 10.1109/4235.996017.
    """
    try:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.evaluator import Evaluator
        from pymoo.core.problem import Problem
        from pymoo.problems.static import StaticProblem
    except ImportError as error:
        why = why_not_there(error, "pymoo", "besman[transfer]")
        raise TransferError(f"transfer: {why}") from None
    points = np.clip(np.asarray(first, dtype=np.float64), *bounds)
    n_objectives = costs(points[:1]).shape[1]
    problem = Problem(n_var=points.shape[1], n_obj=n_objectives, xl=bounds[0], xu=bounds[1])
    search = NSGA2(pop_size=population, sampling=points, n_offsprings=population)
    search.setup(problem, termination=("n_gen", generations + 1), seed=seed, verbose=False)
    while search.has_next():
        asked = search.ask()
        known = StaticProblem(problem, F=costs(np.asarray(asked.get("X"), dtype=np.float64)))
        Evaluator().eval(known, asked)
        search.tell(infills=asked)
    return np.atleast_2d(np.asarray(search.opt.get("X"), dtype=np.float64))
