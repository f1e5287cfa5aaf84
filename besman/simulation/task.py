"""What every simulated task is: a scene, what it costs, and when it has succeeded.

A kind of task is one file: a subclass of `Task` with its sections, and its entry in
`besman.simulation.tasks.kinds`. All else, from the search to the report, sees the methods here.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable, Sequence
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from besman.config.stage import Config, NotNegative, Positive
from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.episodes import Episodes, Movements, Playback

FloatArray = npt.NDArray[np.float64]

TimeStep = Annotated[float, Field(gt=0, le=0.005)]
Triple = tuple[float, float, float]
PlacedBy = Literal["target", "start_pose", "goal_pose"]


class SimulationConfig(Config):
    """How a task is computed.

    Attributes
    ----------
    time_step_s : float
        Step of the simulation.
    """

    time_step_s: TimeStep = 0.002


class ContactSimulationConfig(SimulationConfig):
    """How a task with contacts is computed.

    Attributes
    ----------
    time_step_s : float
        Step of the simulation.
    contact_time_s : float
        Time constant of a contact (MuJoCo's solref); stiff, or things sink into each other.
    """

    contact_time_s: Positive = 0.004

    @model_validator(mode="after")
    def _contacts_are_resolved(self) -> Self:
        """Refuse contacts that the integrator cannot resolve."""
        if self.contact_time_s < 2 * self.time_step_s:
            raise ValueError(
                f"contact_time_s must be at least two time steps of {self.time_step_s:g} s"
            )
        return self


class RewardConfig(Config):
    """Reward of an episode: minus the sum of these terms.

    A further term of a kind is named after what it measures: ``tilt_per_rad`` is multiplied with
    what `Task.measure` gives as ``tilt_rad``.

    Attributes
    ----------
    miss_per_m : float
        Times the distance between outcome and target.
    limit_excess_per_rad : float
        Times the sum over joints of how far positions go beyond their limits.
    collision_per_m : float
        Times the depth to which links enter each other or the pedestal.
    failure : float
        If the episode failed: once for that, and once more times how far it was from being none.
    """

    miss_per_m: NotNegative = 1.0
    limit_excess_per_rad: NotNegative = 10.0
    collision_per_m: NotNegative = 50.0
    failure: NotNegative = 5.0


class TrackingFailureConfig(Config):
    """What counts as a failed episode.

    Attributes
    ----------
    greatest_tracking_error_rad : float
        Greatest deviation of any joint from the movement.
    """

    greatest_tracking_error_rad: Positive = 0.05


class SuccessConfig(Config):
    """An episode succeeds if its outcome is within this distance of the target."""

    success_radius_m: Positive = 0.05


class Task(Config):
    """A task; the sections are those of its file in ``configs/tasks``.

    Attributes
    ----------
    kind : str
        Which task it is.
    tool : str
        Tool of the robot.
    motion_plan : str
        The kind of motion plan that the task is made for.
    simulation, reward, failure, success
        See the classes.
    """

    kind: str
    tool: str
    motion_plan: Literal["joint_dmp", "joint_dmp_velocity", "cartesian_dmp"] = "joint_dmp"
    simulation: SimulationConfig = SimulationConfig()
    reward: RewardConfig = RewardConfig()
    failure: TrackingFailureConfig = TrackingFailureConfig()
    success: SuccessConfig = SuccessConfig()

    needs: ClassVar[str] = "target"
    """What a motion plan must bring along, for the message when it does not."""

    placed_by: ClassVar[tuple[PlacedBy, ...]] = ("target",)
    """Fields of a motion plan that say where the task's things stand: for templates the first one
    does, and the others move with it."""

    worst: ClassVar[dict[str, float]] = {}
    """What a measure costs that is not finite."""

    @property
    def success_radius_m(self) -> float:
        """Greatest distance between outcome and target, metres."""
        return self.success.success_radius_m

    @property
    def fixed_by(self) -> str:
        """The setting that keeps the task's things where they are, whatever the plan; or ""."""
        return ""

    def aimed_by_plan(self) -> Task:
        """Return the task whose target is that of a motion plan, whatever a setting says.

        A template's context says where the target is.
        """
        return self

    @property
    @abstractmethod
    def rest_s(self) -> float:
        """How long the simulation goes on after the movement, seconds."""

    @abstractmethod
    def simulate(
        self, robot: Robot, plans: Sequence[AnyPlan], movements: Movements, paths: bool
    ) -> Episodes:
        """Perform movements in the task's scene.

        Parameters
        ----------
        robot : Robot
            With the task's tool.
        plans : sequence of MotionPlan or CartesianPlan
            Whose movements they are; all of one `scene`.
        movements : Movements
            What `move` gave.
        paths : bool
            Whether to give the paths of what is thrown or carried, and the playbacks.

        Returns
        -------
        Episodes
            Each is what it would be alone.
        """

    def play(self, robot: Robot, plan: AnyPlan) -> Playback:
        """Perform one motion plan to be looked at."""
        movement = self.move([plan], robot)
        return self.simulate(robot, [plan], movement, paths=True).playbacks[0]

    def place(self, plan: AnyPlan, robot: Robot) -> AnyPlan:
        """Return an imitation with the task's own target, if it has one.

        Called once, before the search, which changes neither the target nor the demonstrated
        start and end pose: they say where the task's things stand.
        """
        return plan

    def search_start(self, plan: AnyPlan, robot: Robot) -> AnyPlan:
        """Return the plan that the search for a better one begins with; that which was placed.

        Of what it returns it returns the same.
        """
        return plan

    def wanted(self, plan: AnyPlan) -> FloatArray:
        """Return the numbers without which a plan does not fit the task: NaN if it lacks them."""
        return np.concatenate([getattr(plan, name) for name in self.placed_by])

    def target(self, plan: AnyPlan) -> FloatArray:
        """Return what the outcome is compared with, shape (3,), metres in the robot's world."""
        return plan.target

    def scene(self, plan: AnyPlan, robot: Robot) -> Hashable:
        """Return where the things of the scene stand, if that depends on the plan."""
        return None

    def move(self, plans: Sequence[AnyPlan], robot: Robot | None) -> Movements:
        """Roll out motion plans at the task's time step, with the time that it needs after them.

        Cartesian plans need the robot, for their inverse kinematics.
        """
        from besman.motion.rollout import roll_out_plans

        durations = np.array([plan.duration for plan in plans])
        step = self.simulation.time_step_s
        time = step * np.arange(int(np.ceil((durations.max() + self.rest_s) / step)) + 1)
        return Movements(*roll_out_plans(plans, time, robot), durations)

    def miss(self, plan: AnyPlan, outcome: FloatArray) -> float:
        """Return the distance of an outcome (3,) to the target, metres; NaN without an outcome."""
        return float(np.linalg.norm(outcome - self.target(plan)))

    def residual(self, plan: AnyPlan, episodes: Episodes, index: int) -> FloatArray:
        """Return how far an episode's outcome is off, and whither, in radii of success.

        Returns
        -------
        array, shape (R,)
            Its norm is 1 where the task has just succeeded, if nothing failed. Empty if the task
            only succeeds or not: then there is nothing to take Newton steps on.
        """
        return np.empty(0)

    def measure(self, plan: AnyPlan, episodes: Episodes, index: int) -> dict[str, float]:
        """Return what else an episode is judged by, the unit at the end of each name."""
        return {name: float(values[index]) for name, values in episodes.measures.items()}

    def costs(self, measures: dict[str, float]) -> dict[str, float]:
        """Return what the measures cost by the weights of the reward."""
        costs = {}
        for name, value in measures.items():
            quantity, _, unit = name.rpartition("_")
            weight = f"{quantity}_per_{unit}"
            finite = value if np.isfinite(value) else self.worst[name]
            costs[weight] = getattr(self.reward, weight) * finite
        return costs

    def succeeds(self, miss: float, measures: dict[str, float], share: float = 1.0) -> bool:
        """Tell whether an episode that did not fail meets the criterion.

        Parameters
        ----------
        miss : float
            Distance to the target, metres.
        measures : dict of float
            What `measure` gave.
        share : float
            Share of the greatest permitted errors that may be used up.
        """
        return miss <= share * self.success_radius_m
