"""The search for one motion: what was tried, what is best, whether to go on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from besman.motion.rollout import sample_plan
from besman.records import AnyPlan, RefinedMotion
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.robot.model import Robot
from besman.search.protocol import ResidualSearch, Search
from besman.search.relay import Relay
from besman.simulation.perturbed_trials import try_finely
from besman.simulation.task import Task
from besman.simulation.trial import Trial
from besman.stages.refine.checkpoint import Generation
from besman.stages.refine.choice import pick_milestones
from besman.stages.refine.class_model import ClassModel
from besman.stages.refine.outcomes import cost_of, count_failures, holds, residual_of, succeeds
from besman.stages.refine.plan_space import Space
from besman.stages.refine.racing import race

FloatArray = npt.NDArray[np.float64]

_Pairs = Sequence[tuple[Trial, tuple[Trial, ...]]]
Attempt = Callable[[AnyPlan, int], Trial]

# A search ends when the outcome is this much better than the task asks for.
_MARGIN = 0.5


class MotionSearch:
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
    shared : ClassModel, optional
        What the search knows beforehand.
    n_models : int
        In how many perturbed models motions race, if the search takes no residuals.
    """

    def __init__(
        self,
        space: Space,
        search: Search,
        robot: Robot,
        task: Task,
        episodes: int,
        shared: ClassModel | None = None,
        n_models: int = 0,
    ) -> None:
        self._shared = shared
        # Asked once: Python looks through all that such a search has.
        self._steps = search if isinstance(search, ResidualSearch) else None
        self._n_models = 0 if self._steps is not None else n_models
        self._space, self._search, self._robot = space, search, robot
        self._task, self._episodes = task, episodes
        self._points: FloatArray = np.empty((0, space.dimension))
        self._plans: list[AnyPlan] = []
        self._tried: list[FloatArray] = []
        self._trials: list[Trial] = []
        self._worlds: list[tuple[Trial, ...]] = []
        self._finer: dict[int, FloatArray] = {}  # outcomes of episodes at the finer step
        self._generations: list[int] = []
        self._n_generations = self._again = 0

    def propose(self) -> list[AnyPlan]:
        """Return the motion plans to try next: first the imitation, then one generation."""
        self._points = self._next_points()
        self._plans = [self._space.plan_at(point) for point in self._points[: self._left]]
        return self._plans

    @property
    def in_worlds(self) -> bool:
        """Whether the plans proposed last are to be tried in all models of the world."""
        return bool(self._trials) and self._steps is not None and self._steps.in_worlds

    def learn(
        self,
        trials: list[Trial],
        worlds: Sequence[tuple[Trial, ...]] = (),
        attempt: Attempt | None = None,
        finer: Sequence[Trial] = (),
    ) -> Generation:
        """Take what came of the plans that were proposed last; return that generation.

        `worlds` is what came of each in perturbed models, `finer` at the finer step, if they are
        tried there; where they race, `attempt` gives what comes of a plan in one of the models.

        A success counts if it keeps all limits at 1 kHz, and is one at a quarter of the time step
        too: what a coarse simulation alone makes of a contact is of no use on an arm. That is tried
        where the search might end with it, see `settle` for the rest.
        """
        verified = [self._verify(*pair) for pair in zip(self._plans, trials, strict=True)]
        pairs = zip(verified, worlds or [()] * len(verified), strict=True)
        at = [row for row, pair in enumerate(pairs) if self._counts(*pair)]
        plans = [self._plans[row] for row in at if not finer]
        found = [finer[row] for row in at if finer] or try_finely(self._robot, self._task, plans)
        for row, fine in zip(at, found, strict=True):
            self._finer[len(self._trials) + row] = fine.outcome
            verified[row] = verified[row] if fine.success else fine
        if self._n_models and attempt is not None:
            worlds = self._race(verified, attempt)
        return self._take(Generation(self._points, tuple(verified), tuple(worlds)))

    def _race(self, trials: Sequence[Trial], attempt: Attempt) -> list[tuple[Trial, ...]]:
        """Let those of the plans proposed last race that have succeeded with a margin."""
        found: list[tuple[Trial, ...]] = [()] * len(trials)
        entered = [at for at, one in enumerate(trials) if succeeds(one, self._task, _MARGIN)]
        done = [count_failures(one) for one in self._worlds if len(one) == self._n_models]
        raced = race(
            [trials[at].reward for at in entered],
            self._n_models,
            self._episodes - self.n_episodes - len(trials),
            min(done, default=self._n_models),
            lambda entry, model: attempt(self._plans[entered[entry]], model),
        )
        for at, others in zip(entered, raced, strict=True):
            found[at] = others
        return found

    def settle(self) -> None:
        """Make sure that the best trial, if it has succeeded, does so at the finer step too.

        To be called when the search is over. If none does, and there are episodes left, it is not:
        steps have ended with what does not hold, and another search goes on.
        """
        settled = -1
        while self._trials and self._best != settled and self.best_trial.success:
            settled = self._best
            if not self._counts(self.best_trial, self._worlds[settled]):
                (fine,) = try_finely(self._robot, self._task, [self.best_plan])
                self._finer[settled] = fine.outcome
                self._trials[settled] = self.best_trial if fine.success else fine
        over = self._trials and not self.best_trial.success and self._search.exhausted
        if over and self._left > 0 and self._steps is not None:
            self._steps.hand_over()

    def _counts(self, trial: Trial, others: Sequence[Trial]) -> bool:
        """Tell whether a trial is one at the finer step too as soon as it has succeeded.

        Steps in the model as it is alone go on from what that finer step says.
        """
        alone = self._steps is not None and self._steps.n_worlds == 1
        return trial.success if alone else self._may_end(trial, others)

    def _may_end(self, trial: Trial, others: Sequence[Trial]) -> bool:
        """Tell whether the search might end with a trial: then it is one at the finer step too."""
        if not trial.success:
            return False
        if self._steps is not None and self._steps.n_worlds > 1:
            return bool(others) and holds((trial, *others))
        return succeeds(trial, self._task, _MARGIN)

    def repeat(self, generations: Sequence[Generation]) -> bool:
        """Take what a search before this one, of the same config and seed, has tried.

        Parameters
        ----------
        generations : sequence of Generation
            From the first on.

        Returns
        -------
        bool
            False if this search would have asked for other points; it is then of no use.
        """
        for generation in generations:
            if self.waiting:
                break
            if self._trials and not self.may_go_on:
                self.settle()
            points = self._next_points()
            n = min(len(points), self._left)
            if not np.array_equal(points, generation.points) or n != len(generation.trials):
                return False
            self._take(generation)
        return True

    def _next_points(self) -> FloatArray:
        """Return the points of the next generation, shape (P, D)."""
        return self._search.ask() if self._trials else np.zeros((1, self._space.dimension))

    def _take(self, generation: Generation) -> Generation:
        """Add a generation to what was tried."""
        points, trials = generation.points, generation.trials
        worlds = generation.worlds or ((),) * len(trials)
        if isinstance(self._search, Relay) and self._search.begun_again and not self._again:
            self._again = len(self._trials)
        # A generation cut short by the budget is the last one: there is nothing to learn for.
        if len(trials) == len(points):
            pairs = list(zip(trials, worlds, strict=True))
            returns = np.array([np.mean([t.reward for t in (one, *more)]) for one, more in pairs])
            if self._steps is not None:
                self._tell_residuals(self._steps, points, returns, pairs)
            elif self._trials:
                self._search.tell(points, returns)
        self._tried += list(points[: len(trials)])
        self._trials += trials
        self._worlds += worlds
        self._generations += [self._n_generations] * len(trials)
        self._n_generations += 1
        return generation

    def _tell_residuals(
        self, steps: ResidualSearch, points: FloatArray, returns: FloatArray, pairs: _Pairs
    ) -> None:
        """Tell a search of the outcomes; of the imitation's too, which it had not asked for."""
        found = [np.stack([residual_of(one) for one in (first, *more)]) for first, more in pairs]
        if self._trials:
            steps.tell(points, returns, np.stack(found))
        else:
            steps.tell_start(points[0], found[0])

    @property
    def n_episodes(self) -> int:
        """Episodes tried so far, those in perturbed models among them."""
        return len(self._trials) + sum(map(len, self._worlds))

    @property
    def n_generations(self) -> int:
        """Generations tried so far, the imitation's own among them."""
        return self._n_generations

    @property
    def won(self) -> bool:
        """Whether a trial has succeeded with a margin, in the perturbed models if they count."""
        if not self._trials:
            return False
        others = self._worlds[self._best]
        raced = not self._n_models or (len(others) == self._n_models and not count_failures(others))
        return raced and self._may_end(self.best_trial, others)

    @property
    def done(self) -> bool:
        """Whether the search is over: success with a margin, no budget, or no progress."""
        return bool(self._trials) and (not self.may_go_on or self.won)

    @property
    def waiting(self) -> bool:
        """Whether it has stalled, and is to be given other places to begin at."""
        return isinstance(self._search, Relay) and self._search.waiting

    @property
    def _left(self) -> int:
        """How many more points may be tried, each in all models if they are."""
        each = self._search.n_worlds if self.in_worlds else 1  # type: ignore[attr-defined]
        return (self._episodes - self.n_episodes) // each

    @property
    def may_go_on(self) -> bool:
        """Whether there is something left to try, be it needed or not."""
        return self._left > 0 and not self._search.exhausted

    @property
    def _best(self) -> int:
        """The episode of the best trial, the earliest of equals.

        Of two that succeed the one that was tried in perturbed models is better.
        """
        return max(range(len(self._trials)), key=self._ranks.__getitem__)

    @property
    def _ranks(self) -> list[tuple[float, ...]]:
        return [self._rank(at) for at in range(len(self._trials))]

    def _rank(self, at: int) -> tuple[float, ...]:
        """Say how good an episode is."""
        trial, others = self._trials[at], self._worlds[at]
        if not trial.success:
            return False, trial.reward
        if self._n_models:
            return True, bool(others), -count_failures(others), len(others), trial.reward
        return True, bool(others), -cost_of((trial, *others)) if others else trial.reward

    @property
    def best_trial(self) -> Trial:
        """The best trial."""
        return self._trials[self._best]

    @property
    def best_plan(self) -> AnyPlan:
        """The plan of the best trial."""
        return self._space.plan_at(self._tried[self._best])

    @property
    def best_point(self) -> FloatArray:
        """The point of the best trial, shape (D,)."""
        return self._tried[self._best]

    @property
    def newton_jacobian(self) -> FloatArray | None:
        """The Jacobian as the search has corrected it, shape (W, R, D)."""
        return None if self._steps is None else self._steps.jacobian

    def look_at_all_worlds(self, point: FloatArray) -> None:
        """Have the search look at all worlds from the first step on, from a point (D,)."""
        if self._steps is not None:
            self._steps.enter_worlds(point)

    @property
    def handed_over(self) -> str:
        """Why another search has had to go on; "" if none had to."""
        if self._shared is not None and self._shared.useless:
            return self._shared.useless
        over = self._steps is not None and self._steps.handed_over
        return "steps stalled" if over else ""

    @property
    def rewards(self) -> FloatArray:
        """Reward of every episode in the task's model, once for each simulation it took."""
        rewards = np.array([trial.reward for trial in self._trials])
        return np.repeat(rewards, [1 + len(others) for others in self._worlds])

    def _verify(self, plan: AnyPlan, trial: Trial) -> Trial:
        """Check the limits of a success sample by sample at 1 kHz: nothing less is exported."""
        if not trial.success:
            return trial
        report = check_limits(self._robot, *sample_plan(plan, self._robot)[1:])
        if report.kept:
            return trial
        reward = trial.reward - self._task.reward.failure
        return replace(trial, success=False, failure="limit exceeded", reward=reward)

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
            outcomes=np.array([tried.outcome for tried in self._trials]),
            generations=np.array(self._generations),
            simulations=np.array([1 + len(others) for others in self._worlds]),
            handed_over=self.handed_over,
            shared_simulations=self._shared_simulations,
            begins_again=self._again,
            finer_outcome=self._finer_outcome,
            failure_after=best.failure,
            milestones=tuple(
                (at, self._space.plan_at(self._tried[at])) for at in pick_milestones(self._ranks)
            ),
        )

    @property
    def _finer_outcome(self) -> FloatArray:
        """The best plan's outcome at the finer step, shape (3,); NaN if it has not succeeded."""
        if not self.best_trial.success:
            return np.full(3, np.nan)
        if self._best not in self._finer:
            (fine,) = try_finely(self._robot, self._task, [self.best_plan])
            self._finer[self._best] = fine.outcome
        return self._finer[self._best]

    @property
    def _shared_simulations(self) -> int:
        """What the class has cost, if this is the motion in its middle."""
        mine = self._shared is not None and self._shared.name == self.best_plan.name
        return self._shared.simulations if self._shared is not None and mine else 0
