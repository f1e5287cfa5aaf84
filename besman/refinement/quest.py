"""The search for one motion: what was tried, what is best, whether to go on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from besman.imitation.movement import sample_plan
from besman.records import AnyPlan, RefinedMotion
from besman.refinement.plan_space import Space
from besman.refinement.search import Search
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.robot.model import Robot
from besman.simulation.task import Task
from besman.simulation.trial import Trial

FloatArray = npt.NDArray[np.float64]

# A search ends when the outcome is this much better than the task asks for.
_MARGIN = 0.5


class Quest:
    """The search for one motion, generation by generation.

    Parameters
    ----------
    space : Space
        Motion plans around the imitation.
    search : Search
        Over the space.
    robot : Robot
        Whose limits count.
    task : Task
        What is to be done.
    episodes : int
        Greatest number of episodes, the imitation's own among them.
    """

    def __init__(
        self, space: Space, search: Search, robot: Robot, task: Task, episodes: int
    ) -> None:
        self._space, self._search, self._robot = space, search, robot
        self._task, self._episodes = task, episodes
        self._points: FloatArray = np.empty((0, space.dimension))
        self._plans: list[AnyPlan] = []
        self._tried: list[AnyPlan] = []
        self._trials: list[Trial] = []

    def propose(self) -> list[AnyPlan]:
        """Return the motion plans to try next: first the imitation, then one generation."""
        if not self._trials:
            self._points = np.zeros((1, self._space.dimension))
        else:
            self._points = self._search.ask()
        left = self._episodes - len(self._trials)
        self._plans = [self._space.plan_at(point) for point in self._points[:left]]
        return self._plans

    def learn(self, trials: list[Trial]) -> None:
        """Take what came of the plans that were proposed last."""
        trials = [self._verify(*pair) for pair in zip(self._plans, trials, strict=True)]
        # A generation cut short by the budget is the last one: there is nothing to learn for.
        if self._trials and len(trials) == len(self._points):
            self._search.tell(self._points, np.array([trial.reward for trial in trials]))
        self._tried += self._plans
        self._trials += trials

    @property
    def n_episodes(self) -> int:
        """Episodes tried so far."""
        return len(self._trials)

    @property
    def done(self) -> bool:
        """Whether the search is over: success with a margin, no budget, or no progress."""
        if len(self._trials) >= self._episodes or self._search.exhausted:
            return True
        return succeeds(self._trials[self._best], self._task, _MARGIN)

    @property
    def _best(self) -> int:
        """The episode of the best trial, the earliest of equals."""
        trials = self._trials
        return max(range(len(trials)), key=lambda at: (trials[at].success, trials[at].reward))

    @property
    def best_plan(self) -> AnyPlan:
        """The plan of the best trial."""
        return self._tried[self._best]

    def _verify(self, plan: AnyPlan, trial: Trial) -> Trial:
        """Check the limits of a success sample by sample at 1 kHz: nothing less is exported."""
        if not trial.success:
            return trial
        report = check_limits(self._robot, *sample_plan(plan, self._robot)[1:])
        if report.violations == 0 and report.self_collisions == 0:
            return trial
        penalty = self._task.reward.failure
        return replace(
            trial, success=False, failure="limit exceeded", reward=trial.reward - penalty
        )

    def result(self, trial: Trial) -> RefinedMotion:
        """Sum up the search.

        Parameters
        ----------
        trial : Trial
            The best plan's, with paths.

        Returns
        -------
        RefinedMotion
        """
        plan, before, best = self.best_plan, self._trials[0], self._trials[self._best]
        time, positions, velocities, accelerations = sample_plan(plan, self._robot)
        misses = [np.nan if tried.failure else tried.miss for tried in self._trials]
        return RefinedMotion(
            plan=plan,
            time=time,
            positions=positions,
            velocities=velocities,
            accelerations=accelerations,
            returns=np.array([tried.reward for tried in self._trials]),
            misses=np.array(misses),
            outcome=best.outcome,
            outcome_before=np.full(3, np.nan) if before.failure else before.outcome,
            object_path=trial.object_path,
            tool_path=forward_kinematics(self._robot.chain, positions)[:, :3, 3],
            success=best.success,
            miss_before=float(misses[0]),
            miss=best.miss,
            orientation_error=best.orientation_error,
            failure=before.failure,
        )


def succeeds(trial: Trial, task: Task, share: float) -> bool:
    """Tell whether a trial meets the task's criterion with room to spare.

    Parameters
    ----------
    trial : Trial
        What came of a plan.
    task : Task
        With the criterion.
    share : float
        Share of the greatest permitted errors that may be used up.

    Returns
    -------
    bool
    """
    return trial.success and task.succeeds(trial.miss, trial.measures, share)
