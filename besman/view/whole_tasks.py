"""Whole tasks of a run: what the arm does with boxes, in which block, and what the person did."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from besman.motion.waits import add_waits
from besman.records import BlockDemonstration, FloatArray, HandTrajectory, RefinedTask, TaskPlan
from besman.records.layers import IDLE
from besman.records.task_trial import TaskTrial
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.boxes import BoxFrame
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig
from besman.simulation.tasks.rearrange.rearranging import to_the_floor
from besman.view.outcome_words import outcome_words, with_imitation
from besman.view.packing import Packer
from besman.view.person import PersonMarkers
from besman.view.takes import Performance, played_take


@dataclass(frozen=True, eq=False)
class WholeTasks:
    """Whole tasks that were simulated.

    Attributes
    ----------
    robot : Robot
        With the gripper.
    task : RearrangeConfig
    frame : BoxFrame or None
        None if nothing was imitated.
    demonstrations : dict of BlockDemonstration
        By name, as all that follows.
    plans, aimed : dict of TaskPlan
        As imitated, and brought to their boxes.
    trials : dict of TaskTrial
    refined : dict of RefinedTask
    """

    robot: Robot
    task: RearrangeConfig
    frame: BoxFrame | None
    demonstrations: dict[str, BlockDemonstration]
    plans: dict[str, TaskPlan]
    aimed: dict[str, TaskPlan]
    trials: dict[str, TaskTrial]
    refined: dict[str, RefinedTask]

    @classmethod
    def of(cls, records: dict[str, Any], robot: Robot, task: RearrangeConfig) -> WholeTasks:
        """Sort the records of a run, by their stages."""
        plans = records.get("task_plans", ())
        return cls(
            robot,
            task,
            task.box_frame(plans, robot) if plans else None,
            {one.name: one for one in records.get("blocks", ())},
            {one.name: one for one in plans},
            {one.name: one for one in records.get("aim", ())},
            {one.name: one for one in records.get("simulate", ())},
            {one.plan.name: one for one in records.get("refine_tasks", ())},
        )

    def outcome(self, name: str) -> dict[str, Any] | None:
        """Say what became of a task; None if it was not simulated."""
        first, last = self.trials.get(name), self.refined.get(name)
        trial = last.trial if last is not None else first
        if trial is None:
            return None
        words = outcome_words(trial.miss, trial.failure)
        if first is not None and first is not trial:
            words = with_imitation(words, outcome_words(first.miss, first.failure))
        return {
            "status": "success" if trial.success else "missed",
            "miss": None if trial.failure else _known(trial.miss),
            "reason": words,
        }

    def takes(self, name: str, rate_hz: float) -> list[Performance]:
        """Perform a task as it was imitated, and as it was refined where that is another."""
        aimed, last = self.aimed.get(name), self.refined.get(name)
        shown = []
        if aimed is not None and name in self.trials:
            shown.append(("imitated", aimed, self.trials[name]))
        if last is not None and (last.tries > 1 or not shown):
            best = "refined" if last.trial.success else "best found"
            shown.append((best, last.plan, last.trial))
        return [self._take(title, plan, trial, rate_hz) for title, plan, trial in shown]

    def _take(self, title: str, plan: TaskPlan, trial: TaskTrial, rate_hz: float) -> Performance:
        """Simulate a plan again; say in which block it is when."""
        assert self.frame is not None
        step = self.task.simulation.time_step_s
        playback = self.task.play(plan, self.robot, self.frame)
        take = played_take(playback, step, self.robot, rate_hz)
        # The scene has no floor; what falls would take the picture along.
        take.bodies = to_the_floor(take.bodies)
        take.object_path = to_the_floor(take.object_path[:, None])[:, 0]
        take.title, take.success, take.failure = title, trial.success, trial.failure
        take.miss_m = float(trial.miss)
        spans, shown = block_spans(plan, self.task), self.plans[plan.name]
        straight = {"object": "takes it", "target": "lets go"}
        take.blocks = [
            {"label": straight[block.frame] if way else block.label, "start": start, "end": end}
            for block, (_, way), (start, end) in zip(
                plan.blocks, _of_blocks(shown, plan), spans.tolist(), strict=True
            )
        ]
        person = person_spans(shown, plan, self.demonstrations[plan.name])
        take.clock = [spans.ravel().tolist(), person.ravel().tolist()]
        take.span = [take.clock[0][0], take.clock[0][-1]]
        return take

    def boxes(
        self, hand: HandTrajectory, person: PersonMarkers, packer: Packer
    ) -> list[dict[str, Any]]:
        """Return where the person's boxes are, at the moments of the markers.

        Each has ``size`` (half, metres) and ``poses``: position (m) and heading (rad) in the frame
        of the person, shape (F, 4).
        """
        shown = self.demonstrations.get(hand.name)
        if shown is None or self.frame is None:
            return []
        time = person.start_s + person.interval_s * np.arange(len(person.markers))
        half = [float(size) / 2 for size in self.task.box.size_m]
        found = []
        for thing in range(len(shown.objects)):
            headings = np.unwrap(np.nan_to_num(shown.object_headings[:, thing]))
            cos, sin = np.cos(headings), np.sin(headings)
            x, y, z = self.frame.centre_m
            middle = np.stack([cos * x - sin * y, sin * x + cos * y, np.full_like(cos, z)], axis=1)
            middle += shown.object_positions[:, thing] + (0.0, 0.0, person.back_height_m)
            rows = np.column_stack([middle, headings + self.frame.turn_rad])
            poses = np.stack([np.interp(time, hand.time, column) for column in rows.T], axis=1)
            found.append({"size": half, "poses": packer.add(poses)})
        return found


def block_spans(plan: TaskPlan, task: RearrangeConfig) -> FloatArray:
    """Return when each block begins and ends as the arm waits for its gripper, shape (B, 2), s."""
    wait = task.wait
    closes = np.array([event == "close" for event in plan.events], dtype=np.bool_)
    waits = add_waits(plan.events_s, np.where(closes, wait.closing_s, wait.opening_s))
    borders = plan.starts_s
    # What begins at a moment at which it waits begins after that.
    passed = waits.moments_s[None] <= borders[:, None] + 1e-6
    late = (passed * waits.waits_s).sum(axis=1)
    before = (waits.moments_s[None] < borders[:, None] - 1e-6) * waits.waits_s
    starts, ends = borders + late, borders + before.sum(axis=1)
    return np.column_stack([starts[:-1], ends[1:]])


def person_spans(plan: TaskPlan, aimed: TaskPlan, shown: BlockDemonstration) -> FloatArray:
    """Return when the person does what each block of a task brought to its boxes does.

    While the gripper comes straight to a box, and goes on from there, the person stands still.

    Parameters
    ----------
    plan : TaskPlan
        As imitated.
    aimed : TaskPlan
        See `besman.motion.grasp_goals.lead_grasps`.
    shown : BlockDemonstration

    Returns
    -------
    array, shape (B, 2)
        Seconds on the clock of the demonstration.
    """
    borders = _person_borders(plan, shown)
    spans = [
        (borders[k + 1], borders[k + 1]) if straight else (borders[k], borders[k + 1])
        for k, straight in _of_blocks(plan, aimed)
    ]
    return np.array(spans)


def _of_blocks(plan: TaskPlan, aimed: TaskPlan) -> list[tuple[int, bool]]:
    """Return which imitated block each of a task brought to its boxes is, or leads straight on."""
    found: list[tuple[int, bool]] = []
    for k, block in enumerate(plan.blocks):
        found.append((k, False))
        after = plan.blocks[k + 1] if k + 1 < len(plan.blocks) else None
        same = after is not None and (after.frame, after.thing) == (block.frame, block.thing)
        if block.frame != "world" and not same and len(aimed.blocks) > len(plan.blocks):
            found += [(k, True), (k, True)]
    return found


def _person_borders(plan: TaskPlan, shown: BlockDemonstration) -> FloatArray:
    """Return when the person begins each imitated block, and ends the last, seconds."""
    moving = [k for k, block in enumerate(plan.blocks) if block.label != IDLE]
    end = float(shown.hand.time[-1])
    if len(moving) != len(shown.labels):
        return end * plan.starts_s / plan.duration
    borders = np.full(len(plan.blocks) + 1, np.nan)
    borders[[k + 1 for k in moving]] = shown.bounds_s[:, 1]
    borders[moving] = shown.bounds_s[:, 0]
    borders[0], borders[-1] = 0.0, end
    known = np.flatnonzero(np.isfinite(borders))
    return np.maximum.accumulate(np.interp(np.arange(len(borders)), known, borders[known]))


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
