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
from besman.evaluation.refinement_functions import FUNCTIONS, Attempt, Problem
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

    def attempt(self, method: str, seed: int) -> Attempt:
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
            running.advance()
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


def load_problem(name: str, episodes: int | None = None) -> Problem:
    """Set up a problem; of a task, run its pipeline up to the imitation.

    Parameters
    ----------
    name : str
        Of `FUNCTIONS`, `TASK_RECIPES` or `WHOLE_TASK_RECIPES`, or the path of a pipeline.
    episodes : int, optional
        Of one search of a task; the pipeline's own if not given.

    Raises
    ------
    ConfigError
        If there is no such problem.
    """
    if name in FUNCTIONS:
        return FUNCTIONS[name]()
    recipes = TASK_RECIPES | WHOLE_TASK_RECIPES
    if name not in recipes and not name.endswith(".yaml"):
        raise ConfigError(
            f"--problem: got {name!r}; {nearest(name, (*FUNCTIONS, *recipes))} or a pipeline.yaml"
        )
    path = find_resource("pipelines", recipes.get(name, name))
    config = load_pipeline(path)
    if is_whole_task(config.task):
        return _load_whole_tasks(Path(name).stem, config, episodes)
    with tempfile.TemporaryDirectory() as folder:
        few = config.refine.model_copy(update={"episodes": 1, "robustness": None})
        run = run_pipeline(config.model_copy(update={"refine": few}), Path(folder) / "run")
        plans = open_run(run).record("imitate")
    refine = config.refine if episodes is None else _with_episodes(config.refine, episodes)
    robot, task = load_robot(config.robot, config.tool), load_task(config.task)
    return TaskProblem(Path(name).stem, plans, robot, task, refine)


def _load_whole_tasks(name: str, config: PipelineConfig, episodes: int | None) -> WholeTaskProblem:
    """Run a pipeline of whole tasks, and take its imitations."""
    with tempfile.TemporaryDirectory() as folder:
        plans = open_run(run_pipeline(config, Path(folder) / "run")).record("task_plans")
    robot, task = load_robot(config.robot, config.tool), load_whole_task(config.task)
    return whole_task_problem(name, plans, robot, task, episodes)


def _with_episodes(config: RefinementConfig, episodes: int) -> RefinementConfig:
    return config.model_copy(update={"episodes": episodes})
