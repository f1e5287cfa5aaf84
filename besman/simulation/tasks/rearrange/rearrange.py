"""Boxes are taken, carried, put down and let go, by contact alone, as a task plan says."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np

from besman.exceptions import PlanError, RefinementError
from besman.motion.adapt_task import frame_matrix
from besman.motion.grasp_goals import lead_grasps
from besman.motion.grasp_postures import Postures, check_reach
from besman.motion.grasp_way import GraspWay
from besman.motion.task_rollout import sample_task
from besman.motion.waits import add_waits
from besman.records import BlockPlan, TaskPlan
from besman.records.task_trial import TaskTrial
from besman.robot.model import Robot
from besman.simulation.episodes import Movements, Playback
from besman.simulation.tasks.rearrange.arm_way import ArmWay
from besman.simulation.tasks.rearrange.boxes import BoxFrame, box_poses, frame_of_grasps
from besman.simulation.tasks.rearrange.clearance import Surroundings
from besman.simulation.tasks.rearrange.detours import lead_around
from besman.simulation.tasks.rearrange.sections import GraspConfig, RearrangeFields
from besman.simulation.tasks.rearrange.ways import CLEAR_M, Led, list_aimed

_RATE_HZ = 1000.0


class RearrangeConfig(RearrangeFields):
    """Boxes are carried from place to place; see `RearrangeFields` for its sections."""

    def check_tool(self, robot: str, tool: str) -> None:
        """Refuse a tool, by its name, that is not the task's: a RefinementError."""
        if tool != self.tool:
            raise RefinementError(
                f"task {self.kind}: robot {robot} carries tool {tool!r}, expected {self.tool!r}"
            )

    def check(self, plans: Sequence[TaskPlan], robot: Robot) -> None:
        """Refuse a robot that does not belong to the task or the plans: a RefinementError."""
        self.check_tool(robot.name, robot.tool.name)
        for plan in plans:
            if plan.joint_names != robot.joint_names:
                raise RefinementError(
                    f"{plan.name}: plan for joints {', '.join(plan.joint_names)}; robot "
                    f"{robot.name} has {', '.join(robot.joint_names)}"
                )

    def box_frame(self, plans: Sequence[TaskPlan], robot: Robot) -> BoxFrame:
        """Return where boxes are in the frames of their markers; what is not set, from grasps.

        Raises
        ------
        RefinementError
            If that is not set and nothing is ever taken.
        """
        found = None if self.knows_frame else frame_of_grasps(plans, robot)
        if found is None and not self.knows_frame:
            raise RefinementError(
                f"task {self.kind}: no task takes anything: expected a grasp, or box.centre_m "
                "and box.turn_deg"
            )
        return self.complete_frame(found)

    @property
    def knows_frame(self) -> bool:
        """Whether the config says all of where boxes are in the frames of their markers."""
        return self.box.centre_m is not None and self.box.turn_deg is not None

    def complete_frame(self, found: BoxFrame | None) -> BoxFrame:
        """Return where boxes are: what the config says, and what it does not as it was found."""
        centre, turn = self.box.centre_m, self.box.turn_deg
        return BoxFrame(
            found.centre_m if centre is None and found is not None else np.array(centre),
            found.turn_rad if turn is None and found is not None else np.radians(float(turn or 0)),
            1.0 if found is None else found.thumb,
        )

    def try_tasks(
        self, plans: Sequence[TaskPlan], robot: Robot, frame: BoxFrame, jobs: int = 1
    ) -> list[TaskTrial]:
        """Try tasks, each by itself, in their order; results do not depend on the threads."""
        attempt = partial(self._try_task, robot=robot, frame=frame)
        if jobs > 1 and len(plans) > 1:
            with ThreadPoolExecutor(jobs) as pool:
                return [trial for trial, _ in pool.map(attempt, plans)]
        return [attempt(plan)[0] for plan in plans]

    def play(self, plan: TaskPlan, robot: Robot, frame: BoxFrame) -> Playback:
        """Perform one task to be looked at."""
        return self._try_task(plan, robot, frame)[1]

    def grasp_way(self, frame: BoxFrame, grasp: GraspConfig | None = None) -> GraspWay:
        """Return how the gripper comes to boxes and leaves them; the task's own, or another."""
        grasp = grasp or self.grasp
        return GraspWay(
            frame.grasp,
            np.radians(grasp.pitch_deg),
            grasp.before_m,
            grasp.after_m,
            grasp.up_m,
            grasp.straight_s,
            grasp.higher_m,
            grasp.posture,
        )

    def aim(
        self,
        plan: TaskPlan,
        robot: Robot,
        frame: BoxFrame,
        failed: Callable[[GraspConfig, PlanError], None] = lambda grasp, error: None,
    ) -> Iterator[tuple[GraspConfig, TaskPlan]]:
        """Bring a task to its boxes in one way after the other, those first that touch nothing.

        The task's own way, then all of `ways`; see `list_aimed`.

        Parameters
        ----------
        plan : TaskPlan
        robot : Robot
        frame : BoxFrame
        failed : callable
            Is told of a way that is out of reach or limits.

        Raises
        ------
        OutOfReachError
            Of the first object or place that is, before any way is tried.
        """
        for block in plan.blocks:
            if block.frame != "world":
                standing = plan.object_poses if block.frame == "object" else plan.target_poses
                pose = standing[plan.objects.index(block.thing)]
                self.check_reach(plan.name, robot, frame, block, block.thing, [pose])
        ways = (self.grasp, *self.ways.list(self.grasp))
        postures = Postures(plan, robot, Surroundings.of(plan, robot, self, frame).gaps)
        lead = partial(self.lead, plan, robot, frame, postures=postures)
        return list_aimed(ways, lead, robot, failed)

    def check_reach(
        self,
        name: str,
        robot: Robot,
        frame: BoxFrame,
        block: BlockPlan,
        thing: str,
        poses: Sequence[np.ndarray],
    ) -> None:
        """Refuse markers' poses (7,) at none of which the gripper can have a box.

        Parameters
        ----------
        name : str
            Of the task.
        robot : Robot
        frame : BoxFrame
        block : BlockPlan
            That leads there.
        thing : str
            The box.
        poses : sequence of array, shape (7,)

        Raises
        ------
        OutOfReachError
        """
        pitches = dict.fromkeys((self.grasp.pitch_deg, *self.ways.pitch_deg))
        tools = [
            frame_matrix(pose)
            @ self.grasp_way(frame, self.grasp.model_copy(update={"pitch_deg": pitch})).tool
            for pose in poses
            for pitch in pitches
        ]
        check_reach(name, robot, block.label, block.frame, thing, tools)

    def lead(
        self,
        plan: TaskPlan,
        robot: Robot,
        frame: BoxFrame,
        grasp: GraspConfig,
        places: Sequence[np.ndarray] = (),
        postures: Postures | None = None,
    ) -> Led:
        """Bring a task to its boxes in one way, and tell how near that comes to anything.

        Parameters
        ----------
        plan : TaskPlan
        robot : Robot
        frame : BoxFrame
        grasp : GraspConfig
        places : sequence of array, shape (7,)
            Of other boards; see `Surroundings.of`.
        postures : Postures, optional
            Of the plan between all of these, for who tries several ways.

        Raises
        ------
        PlanError
            If it is out of reach.
        """
        around = Surroundings.of(plan, robot, self, frame, places)
        postures = postures or Postures(plan, robot, around.gaps)
        led = lead_grasps(plan, robot, self.grasp_way(frame, grasp), postures)
        clearance_m = around.clearance(led)
        if clearance_m < CLEAR_M:
            led_around = lead_around(led, robot, around.follow(led))
            if led_around is not None:
                led, clearance_m = led_around, around.clearance(led_around)
        return Led(led, clearance_m)

    def way(self, plan: TaskPlan) -> ArmWay:
        """Roll a task out, with the time that the gripper takes: the arm stands still meanwhile."""
        wait, step = self.wait, self.simulation.time_step_s
        time, *movement = sample_task(plan, _RATE_HZ)
        closes = np.array([event == "close" for event in plan.events], dtype=np.bool_)
        starts = add_waits(plan.events_s, np.where(closes, wait.closing_s, wait.opening_s))
        end = float(time[-1]) + float(starts.sum_s) + wait.settle_s
        new = step * np.arange(int(np.ceil(end / step)) + 1)
        clock, moving = starts.own_time(new)
        q, v, a = (
            np.stack([np.interp(clock, time, column) for column in part.T], axis=1)
            for part in movement
        )
        still = ~(moving & (clock < time[-1]))
        v[still], a[still] = 0.0, 0.0
        movements = Movements(q[None], v[None], a[None], np.array([end]), np.array([end]))
        return ArmWay(movements, starts.starts_s, closes)

    def _try_task(
        self, plan: TaskPlan, robot: Robot, frame: BoxFrame
    ) -> tuple[TaskTrial, Playback]:
        """Simulate one task, and judge it."""
        from besman.simulation.tasks.rearrange.rearranging import judge, simulate_task

        before = box_poses(plan.object_poses, frame)
        after = box_poses(plan.target_poses, frame)
        way = self.way(plan)
        between = box_poses(plan.between_poses, frame)
        model, run = simulate_task(robot, self, way, before, after, between)
        trial = judge(run, self, plan, way, after, robot)
        return trial, Playback(model, run.qpos[0, : run.steps[0]])
