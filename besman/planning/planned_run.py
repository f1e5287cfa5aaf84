"""A plan made from a finished run, and its files in a folder of their own inside the run."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import FileError, PlanError
from besman.foreign.names import fault_of_part_name
from besman.io.atomic_files import folder_aside, make_folder, write_json, write_record
from besman.pipeline.plan_folders import FOLDER, PLAN, plans_made_of
from besman.pipeline.run_lock import take_lock
from besman.pipeline.stage_store import checksum
from besman.pipeline.stored_run import StoredRun
from besman.planning.attempts import LegGoal, TriedLeg, try_legs
from besman.planning.block_effects import same_effect
from besman.planning.goals import Goal, Standing
from besman.planning.learnt import Learnt, read_learnt
from besman.planning.order_search import OrderStep, find_order
from besman.planning.problem import Posed, explain_no_order, holds_already, pose_problem
from besman.records import TaskPlan
from besman.records.task_trial import TaskTrial
from besman.stages.export.motion_exports import is_export
from besman.stages.export.task_exports import write_task_exports
from besman.work.work import Work

RECORD = "plan.npz"


@dataclass(frozen=True, eq=False)
class PlannedBlock:
    """One block of a plan.

    Attributes
    ----------
    label : str
    shown_in : str
        The demonstration that it is taken from.
    thing, place : str
        What it takes, puts or has let go of, and where that is; "" if nothing.
    pose : array, shape (7,), or None
        Where the middle of that stands or is put, in the robot's world.
    start_s, duration_s : float
        On the clock of the plan.
    trial : TaskTrial, optional
        Of all until something is put: of its last block.
    """

    label: str
    shown_in: str
    thing: str
    place: str
    pose: np.ndarray | None
    start_s: float
    duration_s: float
    trial: TaskTrial | None


@dataclass(frozen=True, eq=False)
class Planned:
    """A plan, and what comes of it.

    Attributes
    ----------
    plan : TaskPlan
    goals : tuple of Goal
    start : dict of str to array, shape (7,)
        Where objects stand before: of their middles.
    blocks : tuple of PlannedBlock
    legs : tuple of TriedLeg
    """

    plan: TaskPlan
    goals: tuple[Goal, ...]
    start: dict[str, np.ndarray]
    blocks: tuple[PlannedBlock, ...]
    legs: tuple[TriedLeg, ...]

    @property
    def trial(self) -> TaskTrial:
        """What comes of all."""
        return self.legs[-1].trial

    @property
    def success(self) -> bool:
        """All objects stood where they were to, after each of its legs."""
        return all(leg.trial.success for leg in self.legs)


def plan_goals(
    name: str,
    goals: tuple[Goal, ...],
    start: tuple[Standing, ...],
    learnt: Learnt,
    refine: bool = True,
    done: Callable[[float], None] = lambda share: None,
) -> Planned:
    """Find the shortest order of blocks, bring it to its places, and simulate it.

    Parameters
    ----------
    name : str
    goals : tuple of Goal
    start : tuple of Standing
        See `besman.planning.problem.pose_problem`.
    learnt : Learnt
    refine : bool
        Whether other ways are tried where it does not succeed.
    done : callable
        Takes the share that is done.

    Raises
    ------
    PlanError
        If there is nothing to do, no order of blocks, or one of them is out of reach or limits.
    """
    posed = pose_problem(goals, start, learnt)
    if holds_already(posed):
        raise PlanError(f"{'; '.join(map(_told, goals))}: holds already, there is nothing to do")
    order = find_order(posed.problem)
    if order.steps is None:
        raise PlanError(explain_no_order(posed, order, learnt))
    standing = np.stack([posed.spots[spot].poses[0] for spot in posed.problem.start])
    groups = split_legs(order.steps, learnt)
    legs = [_leg_goal(group, posed, learnt) for group in groups]
    plan, tried = try_legs(name, legs, posed.things, standing, learnt.bench, refine, done)
    blocks = tuple(_describe(groups, tried, posed, learnt))
    return Planned(plan, goals, dict(zip(posed.things, standing, strict=True)), blocks, tried)


def split_legs(steps: Sequence[OrderStep], learnt: Learnt) -> tuple[tuple[OrderStep, ...], ...]:
    """Split an order before each block that leads to an object, but the first."""
    cuts = [k for k, step in enumerate(steps) if learnt.blocks[step.block].frame == "object"]
    ends = [0, *cuts[1:], len(steps)]
    return tuple(tuple(steps[a:b]) for a, b in itertools.pairwise(ends))


def _leg_goal(steps: Sequence[OrderStep], posed: Posed, learnt: Learnt) -> LegGoal:
    """Return what a leg is to do."""
    blocks = tuple(learnt.blocks[step.block] for step in steps)
    put = [step for step, b in zip(steps, blocks, strict=True) if b.frame == "target"]
    alike = tuple((b, *same_effect(b, learnt.blocks)) for b in blocks)
    return LegGoal(alike, put[0].thing, posed.spots[put[0].spot].poses)


def _told(goal: Goal) -> str:
    return " and ".join(map(str, goal))


def _describe(
    groups: Sequence[Sequence[OrderStep]], tried: Sequence[TriedLeg], posed: Posed, learnt: Learnt
) -> list[PlannedBlock]:
    """Say of each block where it leads, and when."""
    found = []
    now = 0.0
    for steps, leg in zip(groups, tried, strict=True):
        # What leads to an object or its place was followed by two straight ways.
        own = iter(leg.plan.blocks)
        for step, (label, source) in zip(steps, leg.sources, strict=True):
            block = learnt.blocks[step.block]
            seconds = sum(next(own).duration for _ in range(1 if block.frame == "world" else 3))
            place = "" if block.frame == "world" else learnt.places[block.place].name
            pose = None
            if block.frame != "world":
                pose = (leg.before if block.frame == "object" else leg.after)[step.thing]
            thing = posed.things[step.thing] if step.thing >= 0 else ""
            put = leg.trial if block.frame == "target" else None
            found.append(PlannedBlock(label, source, thing, place, pose, now, seconds, put))
            now += seconds
    return found


def plan_run(
    folder: Path,
    goals: tuple[Goal, ...],
    start: tuple[Standing, ...] = (),
    name: str | None = None,
    refine: bool = True,
    work: Work = Work(),
) -> tuple[Planned, Path, dict[str, Any]]:
    """Plan with the blocks of a finished run, and write ``plans/NAME`` there.

    Parameters
    ----------
    folder : Path
        The run.
    goals, start, refine
        As of `plan_goals`.
    name : str, optional
        Of the folder; the next free number if not given.
    work : Work
        Progress.

    Returns
    -------
    planned : Planned
    place : Path
        The folder that was written.
    content : dict
        Of ``plan.json`` there.

    Raises
    ------
    RunError, ConfigError
        If the folder is no finished run of whole tasks.
    PlanError
        As of `plan_goals`.
    FileError
        If the name is taken, or nothing can be written.
    """
    if name is not None:
        _check_name(folder, name)
    run, learnt = read_learnt(folder)
    planned = plan_goals("plan", goals, start, learnt, refine, work.progress)
    with take_lock(folder):
        make_folder(folder / FOLDER)
        if name is None:
            name = _next_name(folder)
        _check_name(folder, name)
        place, content = folder / FOLDER / name, plan_results(planned, learnt)
        with folder_aside(place) as temporary:
            content |= _write(planned, learnt, temporary, run, f"plan:{name}")
            write_json(temporary / PLAN, content)
    return planned, place, content


def _write(
    planned: Planned, learnt: Learnt, folder: Path, run: StoredRun, name: str
) -> dict[str, Any]:
    """Write a plan's files for the arm and its record; return their digests."""
    from dataclasses import replace

    plan = replace(planned.plan, name=name)
    write_task_exports((plan,), learnt.bench.robot, folder)
    write_record(folder / RECORD, (plan,))
    files = {path.name: checksum(path) for path in sorted(folder.iterdir()) if is_export(path)}
    return {"of": plans_made_of(run), "files": files | {RECORD: checksum(folder / RECORD)}}


def _check_name(folder: Path, name: str) -> None:
    """Refuse a name that is no name of a folder, or taken."""
    fault = fault_of_part_name(name)
    if fault is None and (Path(name).name != name or name.startswith(".")):
        fault = "is no name of a folder"
    if fault is not None:
        raise FileError(f"--name: {name!r:.80} {fault}")
    if (folder / FOLDER / name).exists():
        raise FileError(f"{folder / FOLDER / name}: is there already; expected another --name")


def _next_name(folder: Path) -> str:
    """Return the first number that is no plan's name."""
    number = 1
    while (folder / FOLDER / str(number)).exists():
        number += 1
    return str(number)


def plan_results(planned: Planned, learnt: Learnt) -> dict[str, Any]:
    """Give a plan's figures for a JSON file.

    Returns
    -------
    dict
        goals, robot, tool; success, failure, miss_m and angle_deg of the whole in simulation,
        duration_s, tries; start and places by name: x_m, y_m, z_m, yaw_deg; blocks: label,
        shown_in, object, place, these four, start_s, duration_s, and of those that put something
        success, failure, miss_m, angle_deg, tries; learnt: label, does, place, hand_before and
        n_shown of all blocks there are.
    """
    trial = planned.trial
    tries = {id(leg.trial): leg.tries for leg in planned.legs}
    return {
        "goals": [_told(goal) for goal in planned.goals],
        "robot": learnt.bench.robot.name,
        "tool": learnt.bench.robot.tool.name,
        **_outcome(trial),
        "success": planned.success,
        "duration_s": planned.plan.duration,
        "simulated_s": trial.duration,
        "tries": sum(leg.tries for leg in planned.legs),
        "start": {thing: _where(pose) for thing, pose in planned.start.items()},
        "places": {place.name: _where(place.pose) for place in learnt.places},
        "blocks": [
            {
                "label": one.label,
                "shown_in": one.shown_in,
                "object": one.thing,
                "place": one.place,
                **({} if one.pose is None else _where(one.pose)),
                "start_s": one.start_s,
                "duration_s": one.duration_s,
                **(
                    {}
                    if one.trial is None
                    else _outcome(one.trial) | {"tries": tries[id(one.trial)]}
                ),
            }
            for one in planned.blocks
        ],
        "learnt": [
            {
                "label": block.label,
                "does": {"world": "moves", "object": "takes", "target": "puts"}[block.frame],
                "object": block.thing,
                "place": learnt.places[block.place].name if block.place >= 0 else "",
                "hand_before": sorted(block.before),
                "n_shown": len(block.uses),
            }
            for block in learnt.blocks
        ],
    }


def _outcome(trial: TaskTrial) -> dict[str, Any]:
    return {
        "success": trial.success,
        "failure": trial.failure,
        "miss_m": trial.miss,
        "angle_deg": float(np.degrees(trial.angle)),
    }


def _where(pose: np.ndarray) -> dict[str, float]:
    """Return a pose as three coordinates and a heading."""
    yaw = float(np.degrees(2.0 * np.arctan2(pose[6], pose[3])))
    place = {f"{axis}_m": float(pose[k]) for k, axis in enumerate("xyz")}
    return place | {"yaw_deg": (yaw + 180.0) % 360.0 - 180.0}
