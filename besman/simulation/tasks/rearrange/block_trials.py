"""Parts of a task, each simulated from the state in which the one before has ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from besman.motion.adapt_task import frame_matrix
from besman.records import TaskPlan
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot
from besman.simulation.episodes import tracking_errors
from besman.simulation.physics import SimulatedStates, run_physics
from besman.simulation.setpoints import expected_movements, servo_setpoints
from besman.simulation.tasks.grasp_box.gripper import FINGERS
from besman.simulation.tasks.rearrange.arm_way import ArmWay
from besman.simulation.tasks.rearrange.boxes import BoxFrame, box_poses
from besman.simulation.tasks.rearrange.clearance import Surroundings
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig
from besman.simulation.tasks.rearrange.rearrange_scene import rearrange_model
from besman.simulation.tasks.rearrange.rearranging import judge, pose_angles, read_touches

FloatArray = npt.NDArray[np.float64]

BlockGoal = Literal["take", "put", "leave"]
"""What a part is for: the box in the hand, at its place, the hand away and at rest."""

_WORST, _FOULED = -2.0, -0.5
# However far a box has fallen; and how much worse one is that does not stay where it is let go.
_FARTHEST_M, _FALLEN_M = 0.9, 0.05
# What a turn counts beside a way, and how far off a box that hangs in the hand is at most.
_M_PER_RAD, _HANGS_M = 0.1, 0.03


class BlockState(NamedTuple):
    """A state between two parts.

    Attributes
    ----------
    qpos : array, shape (nq,)
    qvel : array, shape (nv,)
    closed_m : float
        Where the fingers are sent.
    """

    qpos: FloatArray
    qvel: FloatArray
    closed_m: float


class BlockOutcome(NamedTuple):
    """What came of a part.

    Attributes
    ----------
    reward : float
        Minus metres that its box is off at the end, 0.9 at most, a radian counting as 10 cm; of one
        that does not stay where it is let go, off there, and 5 cm. Less by a half each if the arm
        did not follow or touched a board. -2 if it cannot be done.
    success : bool
    end : BlockState
        As the movement ends, before it has settled: in a whole task the next part begins at once.
    seconds : float
        That were simulated.
    """

    reward: float
    success: bool
    end: BlockState | None
    seconds: float


IMPOSSIBLE = BlockOutcome(_WORST, False, None, 0.0)
"""Of a part that is out of the arm's reach or limits."""


@dataclass(frozen=True, eq=False)
class BlockTrials:
    """The scene of a task in which one box is taken and put.

    Attributes
    ----------
    robot : Robot
    task : RearrangeConfig
    model : mujoco.MjModel
    before, after : array, shape (O, 7)
        Where the middles of boxes stand, and are to stand.
    thing : int
        The box.
    place : array, shape (4, 4)
        The markers of the box where it is to stand, in the frame of the arm.
    around : Surroundings
    """

    robot: Robot
    task: RearrangeConfig
    model: mujoco.MjModel
    before: FloatArray
    after: FloatArray
    thing: int
    place: FloatArray
    around: Surroundings

    @classmethod
    def of(
        cls, plan: TaskPlan, robot: Robot, task: RearrangeConfig, frame: BoxFrame, thing: int
    ) -> BlockTrials:
        """Return the scene of a task."""
        before, after = (box_poses(each, frame) for each in (plan.object_poses, plan.target_poses))
        model = rearrange_model(robot, task, before, after)
        place = frame_matrix(plan.target_poses[thing])
        around = Surroundings.of(plan, robot, task, frame)
        return cls(robot, task, model, before, after, thing, place, around)

    def first(self, joints: FloatArray) -> BlockState:
        """Return the state before anything is done: the arm at rest, its gripper open."""
        qpos = np.concatenate([joints, np.zeros(len(FINGERS)), self.before.ravel()])
        return BlockState(qpos, np.zeros(self.model.nv), 0.0)

    def tool_at_place(self, state: BlockState) -> FloatArray:
        """Return where the tool is to be so that the box that it holds stands at its place.

        Parameters
        ----------
        state : BlockState
            With the box in the hand.

        Returns
        -------
        array, shape (4, 4)
            In the frame of the box's markers there, metres.
        """
        n = self.robot.n
        first = n + len(FINGERS) + 7 * self.thing
        tool = forward_kinematics(self.robot.chain, state.qpos[None, :n])[0]
        box, wanted = (
            frame_matrix(pose) for pose in (state.qpos[first : first + 7], self.after[self.thing])
        )
        found: FloatArray = np.linalg.inv(self.place) @ wanted @ np.linalg.inv(box) @ tool
        return found

    def attempt(self, part: TaskPlan, state: BlockState, goal: BlockGoal) -> BlockOutcome:
        """Simulate a part from a state.

        Parameters
        ----------
        part : TaskPlan
            Within the arm's limits; begins where the arm is.
        state : BlockState
        goal : "take", "put" or "leave"
        """
        way = self.task.way(part)
        run, closed_m = self._simulate(way, state)
        rows = np.array([self._last_row(way)])
        (outcome,) = self._outcomes(run, way, closed_m, rows, (goal,))
        return outcome

    def attempt_whole(
        self, whole: TaskPlan, parts: Sequence[TaskPlan], goals: Sequence[BlockGoal]
    ) -> tuple[BlockOutcome, ...]:
        """Simulate all parts at once, from before the first; judge each where it ends.

        Where the task as a whole fails one of them does: if none at its end, the worst.

        Parameters
        ----------
        whole : TaskPlan
        parts : sequence of TaskPlan
            Of which it is made.
        goals : sequence of str
            What each of them is for.
        """
        way = self.task.way(whole)
        run, closed_m = self._simulate(way, self.first(whole.blocks[0].start))
        rows = np.cumsum([self._last_row(self.task.way(part)) for part in parts])
        outcomes = self._outcomes(run, way, closed_m, rows, goals)
        trial = judge(run, self.task, whole, way, self.after, self.robot)
        if all(outcome.success for outcome in outcomes) and not trial.success:
            worst = min(outcomes, key=lambda outcome: outcome.reward)
            return tuple(one._replace(success=one is not worst) for one in outcomes)
        return outcomes

    def _last_row(self, way: ArmWay) -> int:
        """Return the step at which a movement ends; it settles afterwards."""
        assert way.movements.ends is not None
        moving_s = float(way.movements.ends[0]) - self.task.wait.settle_s
        return int(moving_s / self.task.simulation.time_step_s)

    def _simulate(self, way: ArmWay, state: BlockState) -> tuple[SimulatedStates, FloatArray]:
        """Return what comes of a movement from a state, and where fingers are sent, (T,)."""
        step = self.task.simulation.time_step_s
        arm = servo_setpoints(self.robot, way.movements, step)
        time = step * np.arange(arm.shape[1], dtype=np.float64)
        fingers = way.finger_controls(self.task.gripper, time, state.closed_m)
        run = run_physics(
            self.model,
            state.qpos[None],
            np.concatenate([arm, fingers[None]], axis=2),
            lambda run, span: np.array([False]),
            initial_qvel=state.qvel[None],
        )
        return run, fingers[:, 0]

    def _outcomes(
        self,
        run: SimulatedStates,
        way: ArmWay,
        closed_m: FloatArray,
        rows: npt.NDArray[np.int64],
        goals: Sequence[BlockGoal],
    ) -> tuple[BlockOutcome, ...]:
        """Judge parts that end at rows; the last when all has settled."""
        if not np.isfinite(run.qpos).all():
            return (IMPOSSIBLE,) * len(goals)
        task, step, n = self.task, self.task.simulation.time_step_s, self.robot.n
        n_steps = run.qpos.shape[1]
        expected = expected_movements(self.robot, way.movements, step)
        touches, boards = read_touches(run, len(self.before))
        boxes = run.qpos[0, :, n + len(FINGERS) :].reshape(n_steps, -1, 7)[:, self.thing]
        found = []
        stops = [0, *(rows[:-1] + 1), n_steps]
        for goal, row, (first, stop) in zip(goals, rows, pairwise(stops), strict=True):
            asked = replace(expected, positions=expected.positions[:, first:stop])
            last = np.array([stop - first - 1])
            lag = tracking_errors(run.qpos[:, first:stop, :n], asked, last)
            followed = lag[0] <= task.failure.greatest_tracking_error_rad
            fouls = int(not followed) + int(boards[first:stop].any())
            held = touches[:stop, self.thing]
            off_m, fine = self._judge(boxes[:stop], held, way.commands_s, goal)
            end = BlockState(run.qpos[0, row], run.qvel[0, row], float(closed_m[row]))
            seconds = step * float(stop - first)
            found.append(BlockOutcome(-off_m + _FOULED * fouls, fine and not fouls, end, seconds))
        return tuple(found)

    def _judge(
        self,
        boxes: FloatArray,
        touches: npt.NDArray[np.bool_],
        commands_s: FloatArray,
        goal: BlockGoal,
    ) -> tuple[float, bool]:
        """Return how far off the box is at the end, metres, and whether that will do."""
        success, wanted = self.task.success, np.array(self.after[self.thing])
        if goal == "take":
            wanted = np.array(self.before[self.thing])
            wanted[2] += self.task.grasp.up_m
        miss = float(np.linalg.norm(boxes[-1, :3] - wanted[:3]))
        angle = float(pose_angles(boxes[-1:], wanted[None])[0])
        off_m = min(miss + _M_PER_RAD * angle, _FARTHEST_M)
        turned = angle <= np.radians(success.success_angle_deg)
        if goal == "take":
            held = (touches[-1, 0] | touches[-1, 1]) & touches[-1, 2]
            return off_m, bool(held and turned and miss <= _HANGS_M)
        fine = turned and miss <= success.success_radius_m
        if goal == "put":
            # Where it was let go tells more than where it has fallen to.
            at = min(int(commands_s[-1] / self.task.simulation.time_step_s), len(boxes) - 1)
            fine &= boxes[at, 2] - boxes[-1, 2] <= self.task.failure.greatest_fall_m
            near = float(np.linalg.norm(boxes[at, :3] - wanted[:3]))
            near += _M_PER_RAD * float(pose_angles(boxes[at : at + 1], wanted[None])[0])
            off_m = min(off_m, near + _FALLEN_M) if not fine else off_m
        return off_m, bool(fine)
