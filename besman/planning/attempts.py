"""Legs of a plan aimed, simulated, and if need be tried in other ways, each after those before."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import OutOfReachError, PlanError
from besman.geometry.frames import quaternion_to_rotation, rotation_to_quaternion
from besman.motion.adapt_task import frame_matrix
from besman.planning.block_effects import BlockUse, LearntBlock
from besman.planning.chaining import Leg, chain_leg, join_legs
from besman.planning.resting import ClearRests, nearest_rest, rest_clear, shown_rests
from besman.records import TaskPlan
from besman.records.task_trial import TaskTrial
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.boxes import BoxFrame, box_poses
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig
from besman.simulation.tasks.rearrange.sections import GraspConfig
from besman.simulation.tasks.rearrange.ways import Led, list_aimed
from besman.stages.refine.one_task import is_better

FloatArray = npt.NDArray[np.float64]

# So many demonstrations of a block are tried, the nearest first.
_MOST_SOURCES = 3
# And so many ways of a leg are looked at, of which so many are simulated.
_MOST_WAYS, _MOST_TRIES = 240, 30
_OVER_M = 0.05
# What is off by less stands where it stood.
_NUDGED_M = 0.002


@dataclass(frozen=True, eq=False)
class Bench:
    """What legs are tried with.

    Attributes
    ----------
    plans : tuple of TaskPlan
        As imitated.
    good : frozenset of int
        Indices of those that succeed as they are: they are taken first.
    robot : Robot
    task : RearrangeConfig
    frame : BoxFrame
    """

    plans: tuple[TaskPlan, ...]
    good: frozenset[int]
    robot: Robot
    task: RearrangeConfig
    frame: BoxFrame

    @cached_property
    def rests(self) -> FloatArray:
        """Where the arm has rested, shape (R, n), rad."""
        return shown_rests(self.plans)


@dataclass(frozen=True, eq=False)
class LegGoal:
    """What one leg is to do.

    Attributes
    ----------
    blocks : tuple of tuple of LearntBlock
        Each block, and after it others that do the same.
    thing : int
        Index of the object.
    poses : tuple of array, shape (7,)
        Where that may be put, the one wanted most first: of its middle, in the world.
    """

    blocks: tuple[tuple[LearntBlock, ...], ...]
    thing: int
    poses: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class TriedLeg:
    """What came of a leg.

    Attributes
    ----------
    plan : TaskPlan
        Of this leg alone.
    sources : tuple of pair of str
        Label and demonstration of each of its blocks.
    before, after : array, shape (O, 7)
        Where the middles of objects stand before, as simulated, and are to stand after it, in the
        world.
    trial : TaskTrial
        Of all legs to its end.
    tries : int
    """

    plan: TaskPlan
    sources: tuple[tuple[str, str], ...]
    before: FloatArray
    after: FloatArray
    trial: TaskTrial
    tries: int


def try_legs(
    name: str,
    goals: Sequence[LegGoal],
    objects: tuple[str, ...],
    standing: FloatArray,
    bench: Bench,
    refine: bool = True,
    done: Callable[[float], None] = lambda share: None,
) -> tuple[TaskPlan, tuple[TriedLeg, ...]]:
    """Try legs one after the other, each from where the ones before have left arm and objects.

    Parameters
    ----------
    name : str
        Of the task.
    goals : sequence of LegGoal
    objects : tuple of str, length O
    standing : array, shape (O, 7)
        Where their middles are before, in the world.
    bench : Bench
    refine : bool
        Whether other ways are tried where a leg does not succeed; without, the first that is within
        the arm's reach and limits stays.
    done : callable
        Takes the share that is done.

    Returns
    -------
    plan : TaskPlan
        All legs as one.
    tried : tuple of TriedLeg
        The last one's trial is that of the whole task. Those after one that does not succeed are
        not tried in other ways.

    Raises
    ------
    PlanError
        If a leg is out of the arm's reach or limits in every way: it names the block.
    """
    _check_reach(name, goals, objects, standing, bench)
    tried: list[TriedLeg] = []
    wanted = standing
    for number, goal in enumerate(goals):
        best: TriedLeg | None = None
        faults: list[tuple[int, PlanError]] = []
        tries, lost = 0, any(not one.trial.success for one in tried)
        places = _other_places(tried, goals[number:])
        rests = ClearRests(name, bench.rests, places, bench.robot, bench.task)
        leg = _Leg(name, goal, objects, standing, wanted, tuple(tried), places, bench, rests)
        ways = list_aimed(
            _ways(goal, standing, bench),
            leg.lead,
            bench.robot,
            partial(_note, faults),
        )
        for way, plan in itertools.islice(ways, _MOST_TRIES):
            tries += 1
            found = leg.simulate(way, plan)
            if best is None or is_better(found.trial, best.trial):
                best = found
            if best.trial.success or not refine or lost:
                break
        if best is None:
            # Why the way failed that came farthest, the first of these.
            raise max(faults, key=lambda fault: fault[0])[1]
        best = replace(best, tries=tries)
        tried.append(best)
        standing, wanted = _stood(best), best.after
        done((number + 1) / len(goals))
    return join_legs(name, [one.plan for one in tried]), tuple(tried)


def _stood(leg: TriedLeg) -> FloatArray:
    """Return where objects stand after a leg, upright, shape (O, 7): the next takes them there.

    As simulated: what slips a little in the hand would be gripped beside its middle, and fall.
    """
    stood = np.array(leg.after)
    if not leg.trial.success:
        return stood
    found = leg.trial.outcomes
    off = np.linalg.norm(found[:, :2] - stood[:, :2], axis=1) >= _NUDGED_M
    heading = quaternion_to_rotation(found[:, 3:])
    half = 0.5 * np.arctan2(heading[:, 1, 0], heading[:, 0, 0])
    stood[off, :2] = found[off, :2]
    stood[off, 3:] = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)[off]
    return stood


def _other_places(tried: Sequence[TriedLeg], to_come: Sequence[LegGoal]) -> tuple[FloatArray, ...]:
    """Return where objects stood before legs that were tried, and stand after any: boards stay."""
    stood = [pose for leg in tried for pose in (*leg.before, *leg.after)]
    known = {pose.tobytes(): pose for pose in (*stood, *(goal.poses[0] for goal in to_come))}
    return tuple(known.values())


class _Way(NamedTuple):
    """One way to do a leg: where its object is put, shown by whom, and how it is grasped."""

    pose: FloatArray
    uses: tuple[BlockUse, ...]
    grasp: GraspConfig


def _ways(goal: LegGoal, standing: FloatArray, bench: Bench) -> Iterator[_Way]:
    """Return ways to do a leg, those first that are least far from what is wanted most."""
    grasps = _rank_grasps(bench.task, len(standing) > 1)
    blocks = [
        tuple(others[min(change, len(others) - 1)] for others in goal.blocks)
        for change in range(max(map(len, goal.blocks)))
    ]
    ranked = [
        [rank_sources(own, goal.thing, standing, pose, bench) for own in blocks]
        for pose in goal.poses
    ]
    found = [
        (away + sum(sources) + change + pose, (grasp, sources, change, pose))
        for pose, orders in enumerate(ranked)
        for change, uses in enumerate(orders)
        for sources in itertools.product(*(range(min(len(own), _MOST_SOURCES)) for own in uses))
        for grasp, (away, _) in enumerate(grasps)
    ]
    for _, (grasp, sources, change, pose) in heapq.nsmallest(_MOST_WAYS, found):
        own = zip(ranked[pose][change], sources, strict=True)
        uses = tuple(shown[source] for shown, source in own)
        yield _Way(goal.poses[pose], uses, grasps[grasp][1])


def _rank_grasps(task: RearrangeConfig, over: bool) -> list[tuple[int, GraspConfig]]:
    """Return ways of the gripper, and how far each is from the first in all of its values.

    What changes one value a little is near, so that the first ones differ in each of them.
    """
    shown, ways = task.grasp, task.ways
    # The hand comes from elsewhere than it was shown to: it is straight ahead early.
    early = sorted({*ways.before_m, shown.before_m}, reverse=True)
    values: dict[str, Sequence[float]] = {"before_m": early}
    for key in type(ways).model_fields:
        values.setdefault(key, list(dict.fromkeys((getattr(shown, key), *getattr(ways, key)))))
    if over:
        # Over the others, which may stand beside it.
        values["up_m"] = (task.box.size_m[2] + _OVER_M, shown.up_m)
    ranked = []
    for number, places in enumerate(itertools.product(*(range(len(v)) for v in values.values()))):
        chosen = {key: v[at] for at, (key, v) in zip(places, values.items(), strict=True)}
        ranked.append((sum(places), number, chosen))
    ranked.sort(key=lambda one: one[:2])
    return [(away, shown.model_copy(update=chosen)) for away, _, chosen in ranked]


def rank_sources(
    blocks: Sequence[LearntBlock], thing: int, standing: FloatArray, pose: FloatArray, bench: Bench
) -> list[list[BlockUse]]:
    """Order the demonstrations of each block: those that succeed, the nearest first."""
    kind = next(block.thing for block in blocks if block.thing)

    def distance(use: BlockUse) -> tuple[bool, float, int]:
        shown = bench.plans[use.task]
        if use.frame == "object":
            standing_then, wanted = shown.object_poses, standing[thing]
        else:
            standing_then, wanted = shown.target_poses, pose
        at = box_poses(standing_then, bench.frame)[shown.objects.index(kind)]
        away = float(np.linalg.norm(at[:3] - wanted[:3]))
        return (use.task not in bench.good, away, use.task)

    return [sorted(block.uses, key=distance) for block in blocks]


def _note(faults: list[tuple[int, PlanError]], way: _Way, error: PlanError) -> None:
    """Note why a way failed, and how far it came."""
    faults.append((_n_reached(error, way), error))


def _n_reached(error: PlanError, way: _Way) -> int:
    """Return how many blocks of a leg were within reach."""
    labels = [use.label for use in way.uses]
    if isinstance(error, OutOfReachError) and error.label in labels:
        return labels.index(error.label)
    return len(labels)


def _check_reach(
    name: str,
    goals: Sequence[LegGoal],
    objects: tuple[str, ...],
    standing: FloatArray,
    bench: Bench,
) -> None:
    """Refuse what is out of reach in every pose that it may have, before anything is tried."""
    markers: FloatArray = np.asarray(np.linalg.inv(bench.frame.matrix), dtype=np.float64)
    seen: set[int] = set()
    for goal in goals:
        first = [standing[goal.thing]] if goal.thing not in seen else []
        seen.add(goal.thing)
        for frame, poses in (("object", first), ("target", list(goal.poses))):
            uses = [use for own in goal.blocks for use in own[0].uses if use.frame == frame]
            if poses and uses:
                block = bench.plans[uses[0].task].blocks[uses[0].block]
                block = replace(block, label=uses[0].label)
                bench.task.check_reach(
                    name, bench.robot, bench.frame, block, objects[goal.thing],
                    list(_moved(np.array(poses), markers)),
                )  # fmt: skip


class _Leg(NamedTuple):
    """A leg in one way after the other, each simulated after the legs before it."""

    name: str
    goal: LegGoal
    objects: tuple[str, ...]
    standing: FloatArray
    wanted: FloatArray
    tried: tuple[TriedLeg, ...]
    places: tuple[FloatArray, ...]
    bench: Bench
    rests: ClearRests

    def after(self, way: _Way) -> FloatArray:
        """Return where objects are to stand afterwards, shape (O, 7)."""
        after = np.array(self.wanted)
        after[self.goal.thing] = way.pose
        return after

    def lead(self, way: _Way) -> Led:
        """Bring the leg to its object and place."""
        bench = self.bench
        # What a plan says of objects is where their markers are.
        markers: FloatArray = np.asarray(np.linalg.inv(bench.frame.matrix), dtype=np.float64)
        poses = (_moved(self.standing, markers), _moved(self.after(way), markers))
        leg = Leg(way.uses, self.goal.thing)
        start = self._start(way.uses[0])
        plan = chain_leg(self.name, leg, bench.plans, self.objects, poses, start)
        plan = rest_clear(plan, self.rests.beside(self.after(way)), bench.robot)
        return bench.task.lead(plan, bench.robot, bench.frame, way.grasp, self.places)

    def _start(self, use: BlockUse) -> FloatArray:
        """Return where the arm is before the leg: as shown, if that is clear, or where it is."""
        if self.tried:
            return self.tried[-1].plan.blocks[-1].goal
        shown = self.bench.plans[use.task].blocks[use.block].start
        return nearest_rest(shown, self.rests.beside(self.standing))

    def simulate(self, way: _Way, plan: TaskPlan) -> TriedLeg:
        """Simulate all legs with this one as the last."""
        bench = self.bench
        joined = join_legs(self.name, [*(one.plan for one in self.tried), plan])
        (trial,) = bench.task.try_tasks([joined], bench.robot, bench.frame)
        sources = tuple((use.label, bench.plans[use.task].name) for use in way.uses)
        return TriedLeg(plan, sources, self.standing, self.after(way), trial, 1)


def _moved(poses: FloatArray, by: FloatArray) -> FloatArray:
    """Return poses, shape (O, 7), of what is fixed to those that are given."""
    matrices = np.stack([frame_matrix(pose) @ by for pose in poses])
    return np.hstack([matrices[:, :3, 3], rotation_to_quaternion(matrices[:, :3, :3])])
