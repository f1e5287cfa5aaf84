"""Learn an upper-level policy: contexts are drawn from a region, tried, and learnt from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, Field

from besman.config.stage import Config, Work
from besman.exceptions import nearest
from besman.records import Record, freeze
from besman.search.contextual import ContextualSearch
from besman.search.kinds import CONTEXTUAL_NAMES, search_kind, usual_spelling
from besman.search.protocol import Part
from besman.search.upper_level import Features, UpperLevelPolicy
from besman.stages.refine.stage import UnitsConfig

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_SEARCH, _CONTEXTS, _CHECKS = range(3)


def _check_method(name: Any) -> Any:
    """Take any spelling of a contextual search."""
    usual = usual_spelling(name) if isinstance(name, str) else name
    if usual not in CONTEXTUAL_NAMES:
        raise ValueError(nearest(str(name), CONTEXTUAL_NAMES))
    return usual


Method = Annotated[str, BeforeValidator(_check_method)]


class TemplateConfig(Config):
    """How a template is learnt.

    Attributes
    ----------
    method : str
        One of `besman.search.kinds.CONTEXTUAL_SEARCHES`.
    episodes : int
        Greatest number of episodes to learn from; whole generations are used.
    checks : int
        Further episodes of the policy that was learnt, without exploration: they say what may be
        expected of it.
    population : int or None
        Episodes per generation; null for what is usual of the method: 50 of C-REPS, of contextual
        CMA-ES twice (4 + 3 ln(D + S)) (1 + 2 S).
    sigma : float or None
        Initial standard deviation, in units of the search; null for what is usual: 0.7 of C-REPS,
        of contextual CMA-ES, which can widen it, 0.3.
    ridge : float or None
        Weight of the policy as it was against each generation's points, see
        `besman.search.upper_level.UpperLevelPolicy.fitted`; null for what is usual: 1e-4 of
        C-REPS, of contextual CMA-ES, which sees one generation at a time, 1e-2.
    features : "affine" or "quadratic"
        Of the context, for the policy's mean.
    seed : int
        Of contexts and search.
    search : list of "start", "goal", "duration", "weights", or None
        What of the motion plan depends on the context; null for goal and duration, and start if
        the task's things stand where the demonstration started.
    n_shapes : int
        How many changes of the weights per joint, the smoothest first.
    units : UnitsConfig
        What one unit of the search changes.
    """

    method: Method = "c_cma_es"
    episodes: Annotated[int, Field(ge=1)] = 3000
    checks: Annotated[int, Field(ge=10)] = 100
    population: Annotated[int, Field(ge=4)] | None = None
    sigma: Annotated[float, Field(gt=0)] | None = None
    ridge: Annotated[float, Field(gt=0)] | None = None
    features: Features = "quadratic"
    seed: Annotated[int, Field(ge=0)] = 0
    search: Annotated[tuple[Part, ...], Field(min_length=1)] | None = None
    n_shapes: Annotated[int, Field(ge=1)] = 2
    units: UnitsConfig = UnitsConfig()

    def generation(self, dimension: int, n_contexts: int) -> int:
        """Return the episodes of a generation, never more than there are."""
        usual = search_kind(self.method).load().usual_generation(dimension, n_contexts)
        return min(self.population or usual, self.episodes)


@dataclass(frozen=True, eq=False)
class Tries(
    Record,
    stored_as="besman.templates.learning:Tries",
    finite=("contexts", "points"),
):
    """Episodes: what was tried in which context, and what came of it.

    Attributes
    ----------
    contexts : array, shape (E, S)
    points : array, shape (E, D)
    rewards : array, shape (E,)
    misses : array, shape (E,)
        Metres; NaN where the episode failed.
    successes : bool array, shape (E,)
    """

    contexts: FloatArray
    points: FloatArray
    rewards: FloatArray
    misses: FloatArray
    successes: BoolArray

    def __post_init__(self) -> None:
        """Copy the arrays, make them read-only and check their shapes."""
        freeze(
            self,
            {
                "contexts": ("E", "S"),
                "points": ("E", "D"),
                "rewards": ("E",),
                "misses": ("E",),
                "successes": ("E",),
            },
            successes=bool,
        )

    def rows(self, rows: slice) -> Tries:
        """Return some of the episodes."""
        return Tries(
            self.contexts[rows],
            self.points[rows],
            self.rewards[rows],
            self.misses[rows],
            self.successes[rows],
        )

    def part(self, first: int, points: FloatArray) -> Tries | None:
        """Return the episodes from `first` on, if they are those of the points (P, D)."""
        part = self.rows(slice(first, first + len(points)))
        return part if np.array_equal(part.points, points) else None

    def joined(self, other: Tries) -> Tries:
        """Return these episodes and others after them."""
        return Tries(
            np.concatenate([self.contexts, other.contexts]),
            np.concatenate([self.points, other.points]),
            np.concatenate([self.rewards, other.rewards]),
            np.concatenate([self.misses, other.misses]),
            np.concatenate([self.successes, other.successes]),
        )


def no_tries(dimension: int, n_contexts: int) -> Tries:
    """Return no episodes."""
    return Tries(
        np.empty((0, n_contexts)),
        np.empty((0, dimension)),
        np.empty(0),
        np.empty(0),
        np.empty(0, dtype=bool),
    )


# Given points (P, D) and contexts (P, S), returns their episodes.
TryPoints = Callable[[FloatArray, FloatArray], Tries]


def learn_policy(
    config: TemplateConfig,
    dimension: int,
    region: FloatArray,
    try_points: TryPoints,
    work: Work = Work(),
    known: Tries | None = None,
    keep: Callable[[Tries], None] | None = None,
) -> tuple[UpperLevelPolicy, Tries, Tries]:
    """Learn a policy that gives a point for every context of a region.

    Parameters
    ----------
    config : TemplateConfig
    dimension : int
        Of the points; the search starts at the origin in every context.
    region : array, shape (2, S)
        Least and greatest context; contexts are drawn from it evenly.
    try_points : callable
        See `TryPoints`.
    work : Work
        Its progress is shown.
    known : Tries, optional
        Episodes of the same search that was stopped: not tried again.
    keep : callable, optional
        Called with all episodes so far after each generation.

    Returns
    -------
    policy : UpperLevelPolicy
    tries : Tries
        What was learnt from, in its order.
    checks : Tries
        The policy's means in contexts that it was not taught with.
    """
    n_contexts = region.shape[1]
    size = config.generation(dimension, n_contexts)
    n_generations = config.episodes // size
    search = make_search(config, dimension, region)
    random = np.random.default_rng((config.seed, _CONTEXTS))
    tries = no_tries(dimension, n_contexts)
    total = n_generations * size + config.checks
    for _ in range(n_generations):
        contexts = random.uniform(region[0], region[1], (size, n_contexts))
        points = search.ask(contexts)
        # The search is set going again by telling it what it was told before.
        part = None if known is None else known.part(len(tries.rewards), points)
        tries = tries.joined(try_points(points, contexts) if part is None else part)
        search.tell(contexts, points, tries.rewards[-size:])
        if keep is not None and part is None:
            keep(tries)
        work.progress(len(tries.rewards) / total)
        if search.exhausted:
            break
    random = np.random.default_rng((config.seed, _CHECKS))
    contexts = random.uniform(region[0], region[1], (config.checks, n_contexts))
    checks = try_points(search.policy.means(contexts), contexts)
    work.progress(1.0)
    return search.policy, tries, checks


def make_search(config: TemplateConfig, dimension: int, region: FloatArray) -> ContextualSearch:
    """Set up the search that a config names, over points of a dimension."""
    seed, ends = (config.seed, _SEARCH), (region[0], region[1])
    search: type[ContextualSearch] = search_kind(config.method).load()
    sigma, ridge = config.sigma or search.usual_sigma, config.ridge or search.usual_ridge
    return search(np.zeros(dimension), sigma, ends, seed, config.features, ridge=ridge)
