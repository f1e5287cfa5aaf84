"""Embodiment mapping: demonstrations as joint trajectories that an arm can run.

References
----------
L. Gutzeit: From human movement recordings to robot behavior, thesis, section 7.1.
L. Gutzeit, A. Fabisch, M. Otto, J. H. Metzen, J. Hansen, F. Kirchner, E. A. Kirchner: The BesMan
learning platform for automated robot skill learning, 2018. doi:10.3389/frobt.2018.00043
"""

from __future__ import annotations

from collections.abc import Mapping as MappingOf
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from besman.exceptions import MappingError
from besman.records import Failure, HandTrajectory, JointTrajectory
from besman.robot.limits import LimitReport
from besman.robot.model import Robot
from besman.stages.map.demonstration import (
    MappingSettings,
    check_demonstration,
    map_one,
    place_target,
    tool_poses,
    why_not,
)
from besman.stages.map.mapping import Correction, Mapping
from besman.stages.map.placement import Placement, correct_placement, find_placement
from besman.stages.map.placement_cost import ArmPaths
from besman.stages.map.surroundings import PlacedScene
from besman.stages.map.what_fits import what_fits, why_it_cannot_fit
from besman.work.outcome import Notes, failure_of
from besman.work.work import Work

if TYPE_CHECKING:
    from besman.simulation.tasks.rearrange.shown_scene import ShownScene

    Scenes = MappingOf[str, ShownScene]

FloatArray = npt.NDArray[np.float64]
NO_SCENES: Scenes = {}

# Half of the work is done in kernels without Python's lock. Processes have loaded what it takes
# while the placement was looked for; a placement of its own is ten times the work.
_PROCESSES_FROM = 8
_CORRECTIONS_FROM = 12
# How many poses of one demonstration are looked at among things, first and then.
_POSES_ALONE = (72, 24)


def map_embodiment(
    demonstrations: tuple[HandTrajectory, ...],
    robot: Robot,
    settings: MappingSettings,
    work: Work = Work(),
    scenes: Scenes = NO_SCENES,
) -> Mapping:
    """Map demonstrations to an arm: one placement for all, then joint angles, then time.

    Parameters
    ----------
    demonstrations : tuple of HandTrajectory
        Of one class.
    robot : Robot
        The arm with its tool.
    settings : MappingSettings
    work : Work
        Threads, processes and progress; what cannot be mapped is in the result.
    scenes : mapping of ShownScene
        What stands around each demonstration, by its name: placement and branches keep clear of it
        where they can.

    Returns
    -------
    Mapping

    Raises
    ------
    MappingError
        If there is no demonstration, or none can be transferred.
    """
    if not demonstrations:
        raise MappingError("map: expected at least one demonstration, got none")
    notes = Notes()
    usable = usable_demonstrations(demonstrations, notes)
    usable = fitting_demonstrations(usable, robot, settings, notes)
    height = back_height(usable)
    placement = find_placement(
        [arm_paths(robot, usable, scenes)],
        settings.search,
        back_height=height,
        jobs=work.jobs,
        progress=work.part(0.0, 0.6).progress,
    )
    noted = replace(work, notes=notes)
    mapped = map_placed(usable, robot, placement, settings, height, noted.part(0.6, 1.0), scenes)
    if work.notes is not None:
        work.notes.add_workers(notes)
    mapping = sort_out(mapped, placement, robot, notes.failures, settings)
    order = {one.name: at for at, one in enumerate(demonstrations)}
    return replace(mapping, failed=tuple(sorted(mapping.failed, key=lambda one: order[one.name])))


def arm_paths(
    robot: Robot, demonstrations: Sequence[HandTrajectory], scenes: Scenes = NO_SCENES
) -> ArmPaths:
    """Return what demonstrations ask of an arm, and what stands around them."""
    paths = [(one.time, tool_poses(one, robot)) for one in demonstrations]
    return ArmPaths(robot, paths, [scenes[one.name] for one in demonstrations] if scenes else ())


@dataclass(frozen=True, eq=False)
class Mapped:
    """One demonstration on one arm.

    Attributes
    ----------
    trajectory : JointTrajectory
    report : LimitReport
        Of its check at 1 kHz.
    correction : Correction, optional
        Where it has a placement of its own.
    """

    trajectory: JointTrajectory
    report: LimitReport
    correction: Correction | None = None

    @property
    def name(self) -> str:
        """The demonstration's name."""
        return self.trajectory.name


def map_placed(
    demonstrations: Sequence[HandTrajectory],
    robot: Robot,
    placement: Placement,
    settings: MappingSettings,
    back_height: float | None,
    work: Work,
    scenes: Scenes = NO_SCENES,
) -> list[Mapped]:
    """Map demonstrations, given the placement of all; move those that it does not serve.

    Parameters
    ----------
    demonstrations : sequence of HandTrajectory
    robot : Robot
    placement : Placement
        The common one.
    settings : MappingSettings
    back_height : float or None
        As in `find_placement`.
    work : Work
    scenes : mapping of ShownScene
        As of `map_embodiment`.

    Returns
    -------
    list of Mapped
        Of those that raised no error, in their order.
    """
    one = partial(
        map_with_placement, placement=placement, robot=robot, settings=settings, scenes=scenes
    )
    mapped = work.part(0.0, 0.6).map(one, demonstrations, processes=_PROCESSES_FROM)
    reasons = {each.name: why_not(each.trajectory, each.report, settings) for each in mapped}
    unserved = [one for one in demonstrations if reasons.get(one.name)]
    if settings.correct and unserved:
        own = partial(
            _map_corrected,
            placement=placement,
            robot=robot,
            settings=settings,
            back_height=back_height,
            reasons=reasons,
            scenes=scenes,
        )
        # One that fails here keeps the reason it has.
        notes = Notes()
        again = replace(work.part(0.6, 1.0), notes=notes)
        found = again.map(own, unserved, processes=_CORRECTIONS_FROM, some=False)
        if work.notes is not None:
            work.notes.add_workers(notes)
        moved = {each.name: each for each in found}
        mapped = [
            each
            if each.name not in moved or reason_of(moved[each.name], settings)
            else moved[each.name]
            for each in mapped
        ]
    return mapped


def usable_demonstrations(
    demonstrations: tuple[HandTrajectory, ...], notes: Notes
) -> tuple[HandTrajectory, ...]:
    """Leave out and note what cannot be mapped at all."""
    usable = []
    for one in demonstrations:
        try:
            check_demonstration(one)
        except MappingError as error:
            notes.failures.append(failure_of(one.name, error))
        else:
            usable.append(one)
    if not usable:
        raise MappingError(
            f"map: none of {len(demonstrations)} demonstrations can be used; {notes.failures[0]}"
        )
    return tuple(usable)


def fitting_demonstrations(
    demonstrations: tuple[HandTrajectory, ...],
    robot: Robot,
    settings: MappingSettings,
    notes: Notes,
) -> tuple[HandTrajectory, ...]:
    """Leave out and note what is too large for an arm wherever it is put, before any search."""
    least_scale = settings.scale[0] if settings.scale else 1.0
    fitting = []
    for one in demonstrations:
        poses = tool_poses(one, robot)
        fit = what_fits(robot, one.time, poses, settings.greatest_error_m)
        reason = why_it_cannot_fit(fit, least_scale)
        if reason:
            notes.failures.append(Failure(one.name, reason))
        else:
            fitting.append(one)
    if not fitting:
        raise MappingError(
            f"map: {robot.name} (tool {robot.tool.name}) is too short for all of "
            f"{len(demonstrations)} demonstrations; {notes.failures[-1]}"
        )
    return tuple(fitting)


def map_with_placement(
    demonstration: HandTrajectory,
    placement: Placement,
    robot: Robot,
    settings: MappingSettings,
    scenes: Scenes = NO_SCENES,
) -> Mapped:
    """Map one demonstration, given the placement of all, and bring its target along."""
    placed = placement.apply(tool_poses(demonstration, robot))
    gaps = None
    if scenes:
        scene = scenes[demonstration.name]
        boards = placement.apply(scene.boxes[: scene.n_boards])
        gaps = PlacedScene(robot, boards, scene.halves[: scene.n_boards]).gaps
    trajectory, report = map_one(demonstration, placed, robot, settings, gaps)
    target = place_target(demonstration.target, placement.pose)
    return Mapped(replace(trajectory, target=target), report)


def _map_corrected(
    demonstration: HandTrajectory,
    placement: Placement,
    robot: Robot,
    settings: MappingSettings,
    back_height: float | None,
    reasons: dict[str, str],
    scenes: Scenes,
) -> Mapped:
    """Map one demonstration with a placement of its own.

    Where the one that keeps clear of what stands around does not serve it, it is looked for with
    fewer poses, and then as if nothing stood there.
    """
    bare = arm_paths(robot, [demonstration])
    arms = [bare]
    if scenes:
        own = arm_paths(robot, [demonstration], scenes)
        arms = [replace(own, n_poses=number) for number in _POSES_ALONE] + arms
    for arm in arms:
        found = _map_moved(demonstration, placement, arm, settings, back_height, reasons, scenes)
        if not reason_of(found, settings):
            break
    return found


def _map_moved(
    demonstration: HandTrajectory,
    placement: Placement,
    arm: ArmPaths,
    settings: MappingSettings,
    back_height: float | None,
    reasons: dict[str, str],
    scenes: Scenes,
) -> Mapped:
    """Map one demonstration with the placement that is best for one arm's path."""
    own = correct_placement(arm, settings.search, placement, back_height)
    middle = np.eye(4)
    middle[:3, 3] = arm.paths[0][1][:, :3, 3].mean(axis=0)
    shift = own.apply(middle)[:3, 3] - placement.apply(middle)[:3, 3]
    turn = own.yaw - placement.yaw
    correction = Correction(
        name=demonstration.name,
        reason=reasons[demonstration.name],
        shift_m=float(np.linalg.norm(shift)),
        turn_rad=float(abs(np.arctan2(np.sin(turn), np.cos(turn)))),
        scale=own.scale / placement.scale,
    )
    mapped = map_with_placement(demonstration, own, arm.robot, settings, scenes)
    return replace(mapped, correction=correction)


def reason_of(mapped: Mapped, settings: MappingSettings) -> str:
    """Say why a mapped demonstration cannot be used; empty if it can."""
    return why_not(mapped.trajectory, mapped.report, settings)


def sort_out(
    mapped: list[Mapped],
    placement: Placement,
    robot: Robot,
    failures: list[Failure],
    settings: MappingSettings,
) -> Mapping:
    """Keep what the arm can run; list the rest with its reason."""
    kept: list[Mapped] = []
    worst = (-1.0, failures[0] if failures else None)
    aimed = any(np.isfinite(one.trajectory.target).all() for one in mapped)
    failed = list(failures)
    for one in mapped:
        trajectory, reason = one.trajectory, reason_of(one, settings)
        if aimed and not np.isfinite(trajectory.target).all():
            reason = "the flight of the thrown object was not seen, so there is no target"
        if reason:
            failed.append(Failure(trajectory.name, reason))
            error = float(trajectory.position_error.max())
            worst = max(worst, (error, failed[-1]), key=lambda pair: pair[0])
        else:
            kept.append(one)
    if not kept:
        raise MappingError(
            f"none of {len(failed)} demonstrations can be transferred to {robot.name} "
            f"(tool {robot.tool.name}); the worst: {worst[1]}"
        )
    return Mapping(
        trajectories=tuple(one.trajectory for one in kept),
        placement=placement.pose,
        failed=tuple(failed),
        terms=placement.terms,
        limit_violations=sum(one.report.violations for one in kept),
        self_collisions=sum(one.report.self_collisions for one in kept),
        scale=placement.scale,
        corrected=tuple(one.correction for one in kept if one.correction is not None),
        torque_ratio=max(one.report.torque_ratio for one in kept),
    )


def back_height(demonstrations: tuple[HandTrajectory, ...]) -> float | None:
    """Return how high the back is above the floor, known where a target on the floor is."""
    heights = [-one.target[2] for one in demonstrations if np.isfinite(one.target).all()]
    return float(np.mean(heights)) if heights else None
