"""Experiment: searches on functions and simulated tasks; episodes and seconds to success."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.evaluation.counted_episodes import add_episodes, watched_episodes
from besman.evaluation.refinement_functions import Attempt, Problem
from besman.evaluation.refinement_problems import TaskProblem
from besman.evaluation.whole_task_problem import WholeTaskProblem
from besman.exceptions import ConfigError, nearest
from besman.search.kinds import usual_spelling
from besman.work.work import Work

FloatArray = npt.NDArray[np.float64]

PROBLEMS = ("sphere", "rosenbrock", "contextual_sphere", "via_points", "obstacles", "stick_throw")
"""What is compared if nothing is asked for."""

QUANTILES = (0.1, 0.25, 0.5, 0.75, 0.9)
_N_PLACES = 60
_SIMULATED = (TaskProblem, WholeTaskProblem)


@dataclass(frozen=True)
class Entry:
    """One search to be made.

    Attributes
    ----------
    problem : int
        Index.
    method : str
    seed : int
    file : Path
        Has a byte for every episode that is done.
    """

    problem: int
    method: str
    seed: int
    file: Path

    @property
    def name(self) -> str:
        """For messages."""
        return f"{self.method}, seed {self.seed}"


def evaluate_refinement(
    problems: Sequence[Problem],
    methods: Sequence[str] | None = None,
    seeds: Sequence[int] = range(5),
    work: Work = Work(),
) -> dict[str, Any]:
    """Search every problem with every method and seed.

    Parameters
    ----------
    problems : sequence of Problem
    methods : sequence of str, optional
        Of each problem those that it knows; all if not given.
    seeds : sequence of int
    work : Work
        Processes and progress.

    Returns
    -------
    dict
        ``experiment`` and ``rows``, one for each problem and method: dataset, source, method,
        seeds, n_runs, success (in words), n_success, episodes_budget, episodes and cpu_s (to
        success, over the runs that succeeded), cpu_s_total (median), final_reward, rewards_at
        (best so far after so many episodes) and curve (episodes, and for each of `QUANTILES` the
        best so far); all but the curve as median, quartiles, mean and standard error; public.

    Raises
    ------
    ConfigError
        If no problem knows a method.
    """
    from threadpoolctl import threadpool_limits

    methods = known_methods(methods, [problem.methods for problem in problems])
    pairs = [
        (at, method)
        for at, problem in enumerate(problems)
        for method in problem.methods
        if methods is None or method in methods
    ]
    searches = [(at, method, seed) for at, method in pairs for seed in seeds]
    budgets = [problems[at].episodes for at, *_ in searches]
    silent = replace(work, progress=lambda done: None)
    # Many small matrices: threads inside BLAS cost more than they bring.
    with (
        threadpool_limits(limits=1, user_api="blas"),
        watched_episodes(budgets, work.progress) as files,
    ):
        entries = [Entry(*one, file) for one, file in zip(searches, files, strict=True)]
        attempts = silent.map(partial(_attempt, problems=tuple(problems)), entries, processes=2)
    work.progress(1.0)
    rows = []
    for index, (at, method) in enumerate(pairs):
        own = attempts[index * len(seeds) : (index + 1) * len(seeds)]
        rows.append(_row(problems[at], method, seeds, own))
    return {"experiment": "refinement", "rows": rows}


def known_methods(
    methods: Sequence[str] | None, of_problems: Sequence[Sequence[str]]
) -> list[str] | None:
    """Return methods by their usual names; None for all.

    Parameters
    ----------
    methods : sequence of str, optional
        As they were asked for.
    of_problems : sequence of sequence of str
        Those that each problem knows.

    Raises
    ------
    ConfigError
        If no problem knows one of them.
    """
    if methods is None:
        return None
    known = dict.fromkeys(method for own in of_problems for method in own)
    for method in methods:
        if usual_spelling(method) not in known:
            raise ConfigError(f"--method: got {method!r}; {nearest(method, known)}")
    return [usual_spelling(method) for method in methods]


def _attempt(entry: Entry, problems: tuple[Problem, ...]) -> Attempt:
    problem = problems[entry.problem]
    found = problem.attempt(entry.method, entry.seed, partial(add_episodes, entry.file))
    add_episodes(entry.file, problem.episodes)
    return found


def _row(
    problem: Problem, method: str, seeds: Sequence[int], attempts: Sequence[Attempt]
) -> dict[str, Any]:
    """Sum up the runs of one search on one problem."""
    best = [best_rewards(one.rewards, problem.episodes) for one in attempts]
    needed = [one.episodes_to_success for one in attempts if one.episodes_to_success is not None]
    spent = [one.cpu_s_to_success for one in attempts if one.cpu_s_to_success is not None]
    places = np.unique(np.geomspace(1, problem.episodes, _N_PLACES).astype(np.int64))
    levels = np.quantile(np.stack(best), QUANTILES, axis=0)[:, places - 1]
    return {
        "dataset": problem.name,
        "source": "simulation" if isinstance(problem, _SIMULATED) else "function",
        "method": method,
        "seeds": list(seeds),
        "n_runs": len(attempts),
        "success": problem.success,
        "n_success": len(needed),
        "episodes_budget": problem.episodes,
        "episodes": summary(needed),
        "cpu_s": summary(spent),
        "cpu_s_total": summary([one.cpu_s for one in attempts]),
        "final_reward": summary([one.final for one in attempts]),
        "rewards_at": {mark: summary([one[mark - 1] for one in best]) for mark in problem.marks},
        "curve": {
            "episodes": places.tolist(),
            **{str(q): level.tolist() for q, level in zip(QUANTILES, levels, strict=True)},
        },
        "public": problem.public.get(method),
    }


def best_rewards(rewards: npt.ArrayLike, n: int) -> FloatArray:
    """Return the best reward up to every episode, shape (n,); after the last one it stays.

    Parameters
    ----------
    rewards : array, shape (E,)
        E is at most n; what is not a number is no reward.
    n : int
    """
    array = np.nan_to_num(np.asarray(rewards, dtype=np.float64), nan=-np.inf)
    best = np.maximum.accumulate(array)
    return np.concatenate([best, np.full(n - len(best), best[-1])])


def summary(values: Sequence[float]) -> dict[str, float | None] | None:
    """Return median, quartiles, mean and standard error over runs; None without values.

    One run alone has no standard error: None.
    """
    if not len(values):
        return None
    array = np.asarray(values, dtype=np.float64)
    low, middle, high = np.quantile(array, (0.25, 0.5, 0.75))
    error = float(array.std(ddof=1) / np.sqrt(len(array))) if len(array) > 1 else None
    return {
        "median": float(middle),
        "q25": float(low),
        "q75": float(high),
        "mean": float(array.mean()),
        "standard_error": error,
    }
