"""Two arms of one robot: mapped arm by arm, with one placement and one clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from besman.exceptions import MappingError
from besman.records import Failure, HandTrajectory, JointTrajectory
from besman.robot.collision import distances_between
from besman.robot.limits import resample_trajectory
from besman.robot.model import Robot
from besman.stages.map.demonstration import MappingSettings
from besman.stages.map.map_demonstrations import (
    Mapped,
    arm_paths,
    back_height,
    map_placed,
    map_with_placement,
    reason_of,
    sort_out,
    usable_demonstrations,
)
from besman.stages.map.mapping import Mapping
from besman.stages.map.placement import Placement, find_placement
from besman.work.outcome import Notes
from besman.work.work import Work

FloatArray = npt.NDArray[np.float64]

_CHECK_HZ = 100.0


def map_two_arms(
    demonstrations: tuple[Sequence[HandTrajectory], Sequence[HandTrajectory]],
    robots: tuple[Robot, Robot],
    settings: MappingSettings,
    work: Work = Work(),
) -> tuple[Mapping, Mapping]:
    """Map demonstrations of both hands to the two arms of a robot.

    One placement is chosen for both, so that the hands are to each other as the person's were.
    What one arm does in a demonstration lasts as long as what the other does. A demonstration is
    transferred if both arms can do it and do not touch each other.

    Parameters
    ----------
    demonstrations : pair of sequences of HandTrajectory
        Of the first and the second arm; those of one name belong together.
    robots : pair of Robot
        Both in one world.
    settings : MappingSettings
        No demonstration gets a placement of its own: its neighbours' hands would not fit.
    work : Work

    Returns
    -------
    pair of Mapping
        Trajectories of one demonstration at the same index.

    Raises
    ------
    MappingError
        If the two arms have no demonstration in common, or none can be transferred.
    """
    settings = replace(settings, correct=False)
    notes = Notes()
    pairs = _pair(*(usable_demonstrations(tuple(part), notes) for part in demonstrations))
    first, second = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    placement = find_placement(
        [arm_paths(robots[0], first), arm_paths(robots[1], second)],
        settings.search,
        back_height=back_height(tuple(first)),
        jobs=work.jobs,
        progress=work.part(0.0, 0.5).progress,
    )
    noted = replace(work, notes=notes)
    mapped = [
        map_placed(part, robot, placement, settings, None, noted.part(start, start + 0.2))
        for part, robot, start in ((first, robots[0], 0.5), (second, robots[1], 0.7))
    ]
    by_name = [{one.name: one for one in part} for part in mapped]
    one = partial(
        _synchronise, by_name=by_name, placement=placement, robots=robots, settings=settings
    )
    both = [pair for pair in pairs if all(pair[0].name in found for found in by_name)]
    together = noted.part(0.9, 1.0).map(one, both, name=lambda pair: pair[0].name)
    return _sort_out_pairs(together, placement, robots, notes.failures, settings)


def _pair(
    first: Sequence[HandTrajectory], second: Sequence[HandTrajectory]
) -> list[tuple[HandTrajectory, HandTrajectory]]:
    """Bring together what both hands do in one demonstration."""
    others = {one.name: one for one in second}
    pairs = [(one, others[one.name]) for one in first if one.name in others]
    if not pairs:
        raise MappingError(
            f"map: the two arms have no demonstration in common: got {len(first)} of the first "
            f"({first[0].name}, ...) and {len(second)} of the second ({second[0].name}, ...)"
        )
    return pairs


def _synchronise(
    pair: tuple[HandTrajectory, HandTrajectory],
    by_name: list[dict[str, Mapped]],
    placement: Placement,
    robots: tuple[Robot, Robot],
    settings: MappingSettings,
) -> tuple[Mapped, Mapped]:
    """Slow the quicker arm down to the slower one."""
    mapped = [found[pair[0].name] for found in by_name]
    durations = [float(one.trajectory.time[-1]) for one in mapped]
    longest = max(durations)
    slow = replace(settings, least_duration_s=longest)
    first, second = (
        one
        if duration >= longest - 1e-9
        else map_with_placement(demonstration, placement, robot, slow)
        for one, duration, demonstration, robot in zip(mapped, durations, pair, robots, strict=True)
    )
    return first, second


def arms_distance(
    robots: tuple[Robot, Robot], trajectories: tuple[JointTrajectory, JointTrajectory]
) -> float:
    """Compute the least distance between two arms that move at the same time.

    Parameters
    ----------
    robots : pair of Robot
    trajectories : pair of JointTrajectory
        An arm that is done stands still.

    Returns
    -------
    float
        Metres between their moving parts; below zero where these overlap.
    """
    dense = [
        resample_trajectory(one.time, one.positions, one.velocities, one.accelerations, _CHECK_HZ)[
            1
        ]
        for one in trajectories
    ]
    longest = max(len(part) for part in dense)
    first, second = (
        np.concatenate([part, np.repeat(part[-1:], longest - len(part), axis=0)]) for part in dense
    )
    return float(distances_between(robots[0].chain, first, robots[1].chain, second).min())


def _sort_out_pairs(
    together: list[tuple[Mapped, Mapped]],
    placement: Placement,
    robots: tuple[Robot, Robot],
    failures: list[Failure],
    settings: MappingSettings,
) -> tuple[Mapping, Mapping]:
    """Keep the demonstrations that both arms can do at the same time."""
    kept: list[tuple[Mapped, Mapped]] = []
    failed = list(failures)
    for first, second in together:
        reason = "; ".join(
            f"{robot.name}: {text}"
            for one, robot in zip((first, second), robots, strict=True)
            if (text := reason_of(one, settings))
        )
        if not reason:
            distance = arms_distance(robots, (first.trajectory, second.trajectory))
            if distance <= 0.0:
                reason = f"the arms touch each other (they overlap by {-1e3 * distance:.0f} mm)"
        if reason:
            failed.append(Failure(first.name, reason))
        else:
            kept.append((first, second))
    if not kept:
        raise MappingError(
            f"none of {len(failed)} demonstrations can be transferred to {robots[0].name} and "
            f"{robots[1].name}; the first: {failed[0]}"
        )
    first_mapping, second_mapping = (
        sort_out([pair[at] for pair in kept], placement, robot, failed, settings)
        for at, robot in enumerate(robots)
    )
    return first_mapping, second_mapping
