"""What searches are compared on: the simulated tasks, beside the functions."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from besman.config.resources import find_resource
from besman.evaluation.names import TASK_RECIPES, WHOLE_TASK_RECIPES
from besman.evaluation.refinement_functions import FUNCTIONS, Attempt, Note, Problem, take_no_note
from besman.evaluation.whole_task_problem import WholeTaskProblem, whole_task_problem
from besman.exceptions import ConfigError, nearest
from besman.pipeline.config import PipelineConfig, load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.pipeline.stored_run import open_run
from besman.records import AnyPlan
from besman.robot.model import Robot, load_robot
from besman.search.kinds import SEARCH_NAMES
from besman.simulation.task import Task
from besman.simulation.tasks.kinds import is_whole_task, load_task, load_whole_task
from besman.stages.refine.class_model import ClassModel
from besman.stages.refine.methods import CONFIGS
from besman.stages.refine.stage import RefinementConfig
from besman.work.display import Display, no_display


@dataclass(frozen=True, eq=False)
class TaskProblem:
    """The imitations of a pipeline in their simulated task; attempts take turns with them.

    Attributes
    ----------
    name, episodes
        See `Problem`.
    plans : tuple of MotionPlan or CartesianPlan
    robot : Robot
    task : Task
    config : RefinementConfig
        The pipeline's; of other searches what they have in common with it.
    """

    name: str
    plans: tuple[AnyPlan, ...]
    robot: Robot
    task: Task
    config: RefinementConfig
    marks: tuple[int, ...] = ()
    public: dict[str, Any] = field(default_factory=dict)
    methods: tuple[str, ...] = SEARCH_NAMES

    @property
    def episodes(self) -> int:
        """Of one search."""
        return self.config.episodes

    @property
    def success(self) -> str:
        """What counts as success, in words."""
        return f"{self.task.kind}: within half of {100 * self.task.success_radius_m:g} cm"

    def attempt(self, method: str, seed: int, note: Note = take_no_note) -> Attempt:
        """Search as the refine stage does, until success with its margin.

        What motions share counts in equal parts for each of them.
        """
        common = self.config.model_dump(include=set(RefinementConfig.model_fields))
        own = self.config.model_dump() if method == self.config.method else common
        config = CONFIGS[method].model_validate({**own, "method": method, "seed": seed})
        at = seed % len(self.plans)
        plan, started = self.plans[at], time.thread_time()
        models = _share(self, config)
        shared, spent = models[at], (time.thread_time() - started) / len(self.plans)
        running = config.running_search(plan, self.robot, self.task, shared=shared)
        search, started = running.search, time.thread_time()
        while not search.done:
            done = search.n_episodes
            running.advance()
            note(search.n_episodes - done)
            if search.done:
                # What does not hold at the finer step is no success; steps may then go on.
                search.settle()
        spent += time.thread_time() - started
        before = 0 if shared is None else round(shared.simulations / models.count(shared))
        rewards = np.concatenate([np.repeat(search.rewards[:1], before), search.rewards])
        return Attempt(
            rewards=rewards[: self.episodes],
            final=float(search.best_trial.reward),
            episodes_to_success=before + search.n_episodes if search.won else None,
            cpu_s=spent,
            cpu_s_to_success=spent if search.won else None,
        )


@lru_cache(maxsize=8)
def _share(problem: TaskProblem, config: RefinementConfig) -> list[ClassModel | None]:
    """Learn what the motions of a problem share, once for a seed of the search."""
    return config.share(problem.plans, problem.robot, problem.task)


def methods_of(name: str) -> tuple[str, ...]:
    """Return the searches that a problem knows, without setting it up.

    Raises
    ------
    ConfigError
        If there is no such problem.
    """
    if name in FUNCTIONS:
        return FUNCTIONS[name]().methods
    whole = is_whole_task(_load_recipe(name).task)
    return (WholeTaskProblem if whole else TaskProblem).methods


def _load_recipe(name: str) -> PipelineConfig:
    """Load the pipeline of a problem that is a task."""
    recipes = TASK_RECIPES | WHOLE_TASK_RECIPES
    if name not in recipes and not name.endswith(".yaml"):
        raise ConfigError(
            f"--problem: got {name!r}; {nearest(name, (*FUNCTIONS, *recipes))} or a pipeline.yaml"
        )
    return load_pipeline(find_resource("pipelines", recipes.get(name, name)))


def load_problem(
    name: str, episodes: int | None = None, display: Display = no_display, jobs: int = 1
) -> Problem:
    """Set up a problem; of a task, run its pipeline up to the imitation.

    Parameters
    ----------
    name : str
        Of `FUNCTIONS`, `TASK_RECIPES` or `WHOLE_TASK_RECIPES`, or the path of a pipeline.
    episodes : int, optional
        Of one search of a task; the pipeline's own if not given.
    display : callable
        Shows the stages of a pipeline.
    jobs : int
        Threads or processes; they change nothing.

    Raises
    ------
    ConfigError
        If there is no such problem.
    """
    if name in FUNCTIONS:
        return FUNCTIONS[name]()
    config = _load_recipe(name)
    if is_whole_task(config.task):
        return _load_whole_tasks(Path(name).stem, config, episodes, display, jobs)
    with tempfile.TemporaryDirectory() as folder:
        own = config.refine
        few = own.model_copy(update={"episodes": 1, "robustness": None})
        config = config.model_copy(update={"refine": few})
        run = run_pipeline(config, Path(folder) / "run", jobs=jobs, display=display)
        plans = open_run(run).record("imitate")
    refine = own if episodes is None else _with_episodes(own, episodes)
    robot, task = load_robot(config.robot, config.tool), load_task(config.task)
    return TaskProblem(Path(name).stem, plans, robot, task, refine)


def _load_whole_tasks(
    name: str, config: PipelineConfig, episodes: int | None, display: Display, jobs: int
) -> WholeTaskProblem:
    """Run a pipeline of whole tasks, and take its imitations."""
    with tempfile.TemporaryDirectory() as folder:
        run = run_pipeline(config, Path(folder) / "run", jobs=jobs, display=display)
        plans = open_run(run).record("task_plans")
    robot, task = load_robot(config.robot, config.tool), load_whole_task(config.task)
    return whole_task_problem(name, plans, robot, task, episodes)


def _with_episodes(config: RefinementConfig, episodes: int) -> RefinementConfig:
    return config.model_copy(update={"episodes": episodes})
