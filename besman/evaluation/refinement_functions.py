"""Functions that searches are compared on, with what others have published."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from besman.evaluation.approximate_ik import PUBLIC, ArmFunction
from besman.search.contextual import ContextualSearch
from besman.search.kinds import CONTEXTUAL_NAMES, SEARCH_NAMES, search_kind
from besman.stages.refine.methods import CONFIGS

FloatArray = npt.NDArray[np.float64]
Note = Callable[[int], None]

# Those of the searches' own publications for so many coordinates, where they differ from what is
# usual for motion plans.
_POPULATIONS: dict[str, int | None] = {
    "cma_es": None,
    "reps": 25,
    "pi2": 20,
    "pi2_cma": 20,
    "cem": 50,
}
_OF_A_GENERATION = 50  # of a contextual search, as in the public figures


@dataclass(frozen=True, eq=False)
class Attempt:
    """What came of one search.

    Attributes
    ----------
    rewards : array, shape (E,)
        Of every episode.
    final : float
        The best of them; of a contextual search the mean of the last generation.
    episodes_to_success : int or None
        How many it took; None if it did not succeed.
    cpu_s, cpu_s_to_success : float, float or None
        CPU time, seconds.
    """

    rewards: FloatArray
    final: float
    episodes_to_success: int | None
    cpu_s: float
    cpu_s_to_success: float | None


def take_no_note(n: int) -> None:
    """Take no note of so many more episodes."""


class Problem(Protocol):
    """Something to search.

    Attributes
    ----------
    name : str
    methods : tuple of str
        That can be tried.
    episodes : int
        Of one search.
    marks : tuple of int
        Numbers of episodes at which the best reward so far is reported.
    public : dict
        What others have published, by the name of the method or policy.
    success : str
        What counts as success, in words.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def methods(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def episodes(self) -> int: ...  # noqa: D102
    @property
    def marks(self) -> tuple[int, ...]: ...  # noqa: D102
    @property
    def public(self) -> dict[str, Any]: ...  # noqa: D102
    @property
    def success(self) -> str: ...  # noqa: D102

    def attempt(self, method: str, seed: int, note: Note = take_no_note) -> Attempt:
        """Search once; what takes long notes on the way how many more episodes are done."""
        ...


@dataclass(frozen=True)
class FunctionProblem:
    """A function of a vector.

    Attributes
    ----------
    name, episodes, marks, public
        See `Problem`.
    function : callable
        Points (P, D) to rewards (P,).
    dimension : int
    start, sigma : float
        First mean and initial standard deviation of every coordinate.
    threshold : float
        A greater reward is a success.
    """

    name: str
    function: Callable[[FloatArray], FloatArray]
    dimension: int
    start: float
    sigma: float
    threshold: float
    episodes: int
    marks: tuple[int, ...] = ()
    public: dict[str, Any] = field(default_factory=dict)
    methods: tuple[str, ...] = SEARCH_NAMES

    @property
    def success(self) -> str:
        """What counts as success, in words."""
        return f"reward above {self.threshold:g}"

    def attempt(self, method: str, seed: int, note: Note = take_no_note) -> Attempt:
        """Search until the budget or the search itself ends."""
        settings = {"population": _POPULATIONS[method]} if method in _POPULATIONS else {}
        config = CONFIGS[method].model_validate({"method": method, "sigma": self.sigma, **settings})
        search = config.make_search(self.dimension, (seed,))
        rewards: list[float] = []
        started, reached = time.thread_time(), None
        while len(rewards) < self.episodes and not search.exhausted:
            points = search.ask()
            points = points[: self.episodes - len(rewards)]
            found = self.function(self.start + points)
            rewards += found.tolist()
            if reached is None and found.max() > self.threshold:
                reached = time.thread_time() - started
            if len(rewards) < self.episodes:
                search.tell(points, found)
        return _attempt(np.array(rewards), self.threshold, time.thread_time() - started, reached)


@dataclass(frozen=True)
class ContextualProblem:
    """A function of a vector that is shifted by the context: f(x + G s), as published.

    Attributes
    ----------
    name, episodes, marks, public
        See `Problem`.
    function : callable
        Points (P, D) to rewards (P,).
    dimension, n_contexts : int
    threshold : float
        A greater mean reward of a generation is a success.
    """

    name: str
    function: Callable[[FloatArray], FloatArray]
    dimension: int
    n_contexts: int
    threshold: float
    episodes: int
    marks: tuple[int, ...] = ()
    public: dict[str, Any] = field(default_factory=dict)
    methods: tuple[str, ...] = CONTEXTUAL_NAMES

    @property
    def success(self) -> str:
        """What counts as success, in words."""
        return f"mean reward of a generation above {self.threshold:g}"

    def attempt(self, method: str, seed: int, note: Note = take_no_note) -> Attempt:
        """Search until the budget ends; contexts are uniform between 1 and 2."""
        random = np.random.default_rng((seed, 1))
        shift = random.standard_normal((self.n_contexts, self.dimension))
        start = random.standard_normal(self.dimension)
        search = self._search(method, start, seed)
        generations: list[FloatArray] = []
        started, reached, needed = time.thread_time(), None, None
        while len(generations) < self.episodes // _OF_A_GENERATION:
            contexts = random.uniform(1.0, 2.0, (_OF_A_GENERATION, self.n_contexts))
            points = search.ask(contexts)
            rewards = self.function(points + contexts @ shift)
            search.tell(contexts, points, rewards)
            generations.append(rewards)
            if reached is None and rewards.mean() > self.threshold:
                reached = time.thread_time() - started
                needed = len(generations) * _OF_A_GENERATION
        return Attempt(
            rewards=np.repeat([one.mean() for one in generations], _OF_A_GENERATION),
            final=float(generations[-1].mean()),
            episodes_to_success=needed,
            cpu_s=time.thread_time() - started,
            cpu_s_to_success=reached,
        )

    def _search(self, method: str, start: FloatArray, seed: int) -> ContextualSearch:
        """Set up a search as for the public figures: affine, sigma 1."""
        region = (np.ones(self.n_contexts), np.full(self.n_contexts, 2.0))
        search: type[ContextualSearch] = search_kind(method).load()
        return search(start, 1.0, region, (seed,), ridge=1e-10)


def _attempt(rewards: FloatArray, threshold: float, cpu_s: float, reached: float | None) -> Attempt:
    """Sum up the search of a function."""
    good = np.flatnonzero(rewards > threshold)
    needed = int(good[0]) + 1 if len(good) else None
    return Attempt(rewards, float(np.nanmax(rewards)), needed, cpu_s, reached)


def sphere(points: FloatArray) -> FloatArray:
    """Return minus the squared norms (P,) of points (P, D)."""
    return np.asarray(-np.sum(np.square(points), axis=1))


def rosenbrock(points: FloatArray) -> FloatArray:
    """Return minus Rosenbrock's function (P,) of points (P, D)."""
    ahead, here = points[:, 1:], points[:, :-1]
    return np.asarray(-np.sum(100.0 * (ahead - here**2) ** 2 + (1.0 - here) ** 2, axis=1))


def _arm_problem(course: Any, policy: Any, name: str) -> FunctionProblem:
    """Set up a function of the benchmark of approximate inverse kinematics, as published."""
    function = ArmFunction(course, policy)
    (_, _), (public, _) = figures = PUBLIC[course, policy]
    return FunctionProblem(
        name=name,
        function=function,
        dimension=function.dimension,
        start=0.0,
        sigma=100.0 if policy == "cartesian" else 200.0,
        threshold=public,
        episodes=2000,
        marks=(500, 2000),
        public={"cma_es": figures},
    )


FUNCTIONS: dict[str, Callable[[], Problem]] = {
    "sphere": lambda: FunctionProblem("sphere", sphere, 20, 1.0, 1.0, -1e-8, 10_000),
    "rosenbrock": lambda: FunctionProblem("rosenbrock", rosenbrock, 20, 0.0, 0.5, -1e-8, 20_000),
    "contextual_sphere": lambda: ContextualProblem(
        "contextual_sphere", sphere, 20, 2, -1e-3, 10_000, public={"c_cma_es": -2e-5, "c_reps": -45}
    ),
    "contextual_rosenbrock": lambda: ContextualProblem(
        "contextual_rosenbrock", rosenbrock, 20, 1, -0.1, 42_500,
        public={"c_cma_es": -2e-3, "c_reps": -1.2e4},
    ),
    "via_points": lambda: _arm_problem("via_points", "cartesian", "via_points"),
    "via_points_joint": lambda: _arm_problem("via_points", "joint", "via_points_joint"),
    "obstacles": lambda: _arm_problem("obstacles", "cartesian", "obstacles"),
    "obstacles_joint": lambda: _arm_problem("obstacles", "joint", "obstacles_joint"),
}  # fmt: skip
