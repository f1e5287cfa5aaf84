"""What refinement gives: a motion plan after the search, and what it does in simulation."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from besman.records.frozen import FloatArray, Record, freeze
from besman.records.plans import AnyPlan


@dataclass(frozen=True, eq=False)
class RefinedMotion(
    Record,
    stored_as="besman.records:RefinedMotion",
    finite=("time", "positions", "velocities", "accelerations"),
    later=(
        "simulations",
        "handed_over",
        "shared_simulations",
        "finer_outcome",
        "begins_again",
        "failure_after",
    ),
):
    """A motion plan after the search, and what it does in simulation.

    Attributes
    ----------
    plan : MotionPlan or CartesianPlan
        The best plan found.
    time : array, shape (T,)
        Seconds, at 1 kHz.
    positions, velocities, accelerations : array, shape (T, n)
        Commanded joint trajectory of the best plan: rad, rad/s, rad/s^2.
    returns : array, shape (E,)
        Return of every episode in the order tried; episode 0 is the imitation as it was.
    misses : array, shape (E,)
        Distance of every episode's outcome to the target, metres (NaN: failed episode).
    outcome : array, shape (3,)
        Touchdown or end position reached by the best plan, metres, robot's world frame.
    outcome_before : array, shape (3,)
        The same for the imitation as it was; NaN if it failed.
    object_path : array, shape (F, 3)
        Path of the thrown object in the best episode, metres (F = 0 if nothing is thrown).
    tool_path : array, shape (T, 3)
        Path of the tool centre point in the best episode, metres.
    success : bool
        The task's success criterion is met and no limit is exceeded.
    miss_before, miss : float
        Distance to the target before and after, metres.
    orientation_error : float
        Radians to the demonstrated end orientation; NaN where the task does not ask for it.
    failure : str
        What ended the imitation's episode before its end ("" if nothing did).
    outcomes : array, shape (E, 3)
        Touchdown or end position of every episode, metres (NaN: none).
    generations : int array, shape (E,)
        Generation of every episode; 0 is the imitation alone.
    milestones : tuple of (int, MotionPlan or CartesianPlan)
        Episodes that were the best so far, each with its plan: the imitation, up to three on the
        way, the best.
    simulations : int array, shape (E,)
        Simulations that every episode took: one, and one for each perturbed model that its plan
        was tried in for the search.
    handed_over : str
        Why CMA-ES had to go on where the search that was asked for did not; "" if it had not.
    shared_simulations : int
        What all motions shared took; told of the motion in their middle alone.
    finer_outcome : array, shape (3,)
        Outcome of the best plan at a quarter of the time step, metres; NaN if it was not tried.
    begins_again : int
        Episode that began a second round, where another motion's search had ended; 0 without one.
    failure_after : str
        What went wrong in the best episode ("" if nothing did).
    """

    plan: AnyPlan
    time: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    returns: FloatArray
    misses: FloatArray
    outcome: FloatArray
    outcome_before: FloatArray
    object_path: FloatArray
    tool_path: FloatArray
    success: bool
    miss_before: float
    miss: float
    orientation_error: float = float("nan")
    failure: str = ""
    outcomes: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    generations: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    milestones: tuple[tuple[int, AnyPlan], ...] = ()
    simulations: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    handed_over: str = ""
    shared_simulations: int = 0
    finer_outcome: FloatArray = field(default_factory=lambda: np.full(3, np.nan))
    begins_again: int = 0
    failure_after: str = ""

    def __post_init__(self) -> None:
        # What an older record does not have is not known of any episode.
        n = len(self.returns)
        if n and not len(self.outcomes):
            object.__setattr__(self, "outcomes", np.full((n, 3), np.nan))
        if n and not len(self.generations):
            object.__setattr__(self, "generations", np.zeros(n))
        if n and not len(self.simulations):
            object.__setattr__(self, "simulations", np.ones(n))
        freeze(
            self,
            {
                "time": ("T",),
                "positions": ("T", "n"),
                "velocities": ("T", "n"),
                "accelerations": ("T", "n"),
                "returns": ("E",),
                "misses": ("E",),
                "outcome": (3,),
                "outcome_before": (3,),
                "object_path": ("F", 3),
                "tool_path": ("T", 3),
                "outcomes": ("E", 3),
                "generations": ("E",),
                "simulations": ("E",),
                "finer_outcome": (3,),
            },
            generations=np.int64,
            simulations=np.int64,
        )

    def is_as_before(self, name: str) -> bool:
        """Tell whether a field is what a file of before gives.

        Every episode was one simulation, and nothing is known of a finer step.
        """
        if name == "simulations":
            return bool(np.all(self.simulations == 1))
        if name == "finer_outcome":
            return bool(np.isnan(self.finer_outcome).all())
        return super().is_as_before(name)
