"""The report's sections on one arm: overview, paths, refinement, every demonstration."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from besman.records import FloatArray, RefinedMotion
from besman.report.drawings import DrawFigure, draw_now
from besman.report.html_tables import html_table
from besman.report.run_records import ArmRecords

# More would take longer to draw than to compute, and nobody looks at hundreds.
_DRAWN = 60
_MOVEMENT = ("time", "positions", "velocities", "accelerations", "object_path", "tool_path")
_FORMATS = (
    (".csv", "CSV"),
    (".ros.json", "ROS"),
    (".ros.yaml", "YAML"),
    (".script", "UR"),
    (".approach.csv", "way there"),
)


def overview_figure(
    records: dict[str, Any], config: dict[str, Any], arm: ArmRecords, draw: DrawFigure = draw_now
) -> str:
    """Draw the demonstration that was refined first.

    Parameters
    ----------
    records : dict
        Of the run's stages.
    config : dict
        The run's ``pipeline.yaml``.
    arm : ArmRecords
        With at least one motion.
    draw : callable
        Draws the figure.

    Returns
    -------
    str
        SVG, or what stands for it.
    """
    from besman.report.overview import overview
    from besman.robot.model import load_robot

    motion = arm.motions[0]
    source, _, segment = motion.plan.name.rpartition(":")
    at = [recording.source for recording in records["label"]].index(source)
    segments = selected_segments(records, config["select"], at)
    return draw(
        overview,
        records["label"][at],
        tuple(segments.bounds[int(segment)]),
        config["select"].get("object"),
        load_robot(arm.config["robot"], arm.config["tool"]),
        motion,
        arm.mapping.placement,
        arm.side,
    )


def selected_segments(records: dict[str, Any], select: dict[str, Any], at: int) -> Any:
    """Return the segments that demonstrations of a recording were selected from."""
    if "actions" in records:
        return records["actions"][at]
    if select.get("action") is None:
        return records["recognize"][at]
    levels = records["compose"][at].levels
    return next((one for one in levels if select["action"] in one.labels), levels[0])


def motion_sections(arm: ArmRecords, results: dict[str, Any], draw: DrawFigure = draw_now) -> str:
    """Draw paths, learning curves and outcomes of an arm.

    Parameters
    ----------
    arm : ArmRecords
    results : dict
        The run's ``results.json``.
    draw : callable
        Draws each figure.

    Returns
    -------
    str
        HTML; "" before refinement.
    """
    if not arm.motions:
        return ""
    from besman.report.figures import paths

    mapped, some = evenly(arm.mapping.trajectories, _DRAWN), evenly(arm.motions, _DRAWN)
    drawn = "".join(
        captioned(
            draw(paths, mapped, some, up),
            f"Path of the tool centre point in the robot's world [m], {view} (floor below the "
            f"base).{_shown(len(arm.motions), 'motions')}",
        )
        for up, view in ((2, "from the side"), (1, "from above"))
    )
    radius = results[f"refine{arm.suffix}"]["success_radius_m"]
    return (
        f'<h2>Demonstrated and executed paths{html.escape(arm.heading)}</h2><div class="pair">'
        f"{drawn}</div>" + _refinement(arm, radius, draw)
    )


def _refinement(arm: ArmRecords, radius: float, draw: DrawFigure) -> str:
    """Draw learning curves, touchdown maps and generations."""
    from besman.report import motion_figures as figures

    # They may be drawn by other processes: what is not looked at is not sent there.
    motions = [without_movement(one) for one in arm.motions]
    ended, tried = ("landed", "throws") if landed(motions) else ("ended", "tries")
    curves = captioned(
        draw(figures.learning_curve, motions, radius),
        f"Best miss so far [cm] over the {tried} of every motion; median and quantiles over "
        f"{len(motions)} motions. A search that has ended keeps its best; one without an outcome "
        "yet counts as the worst. " + _second_round(motions),
    ) + captioned(
        draw(figures.return_curve, motions),
        f"The same for the return: minus the sum of the task's costs, over the {tried}.",
    )
    planes = ((0, 1),) if landed(motions) else ((0, 2), (0, 1))
    some = evenly(motions, _DRAWN)
    maps = "".join(
        captioned(
            draw(figures.touchdown_map, some, _targets(some), radius, plane),
            f"Where motions {ended}, imitated and refined, and their targets, in the robot's "
            f"world [m], {'from above' if plane[1] == 1 else 'from the side'}; the base stands at "
            f"0, 0.{_shown(len(motions), 'motions')}",
        )
        for plane in planes
    )
    if landed(motions):
        maps += captioned(
            draw(figures.outcomes_by_target, some, _targets(some), radius, (0, 1)),
            f"The same relative to each motion's own target [cm].{_shown(len(motions), 'motions')}",
        )
    generations = captioned(
        draw(figures.touchdowns_by_generation, motions, _targets(motions), planes[0]),
        f"Where {tried} of every generation {ended}, relative to their targets [cm].",
    ) + captioned(
        draw(figures.misses_by_generation, motions, radius),
        f"Miss [cm] of the {tried} of each generation, and how many failed [%], over all motions; "
        "generation 0 is the imitation alone.",
    )
    head = html.escape(arm.heading)
    return (
        f'<h2>Refinement in simulation{head}</h2><div class="pair">{curves}</div>'
        f'<h3>Where motions {ended}</h3><div class="pair">{maps}</div>'
        f'<h3>{tried.capitalize()} over generations</h3><div class="pair">{generations}</div>'
    )


def without_movement(motion: RefinedMotion) -> RefinedMotion:
    """Return what a search has come to, without the samples of the best plan's movement."""
    nothing = {name: getattr(motion, name)[:0] for name in _MOVEMENT}
    return replace(motion, milestones=(), **nothing)


def _second_round(motions: Sequence[RefinedMotion]) -> str:
    """Say how many began again, and what that took; "" if none did."""
    again = [one for one in motions if one.begins_again]
    if not again:
        return ""
    since = np.median([one.simulations[one.begins_again :].sum() for one in again])
    return (
        f"{len(again)} of them stalled and began again where the search for a motion with a near "
        f"target had ended (crosses): {since:g} more episodes in the median."
    )


def landed(motions: Sequence[RefinedMotion]) -> bool:
    """Tell whether what counts is where something touched the floor."""
    heights = np.array([motion.outcome[2] for motion in motions])
    finite = heights[np.isfinite(heights)]
    return bool(len(finite) and np.all(finite == 0.0))


def _targets(motions: Sequence[RefinedMotion]) -> FloatArray:
    """Return what motions were to reach, shape (N, 3): the task's target, else the end pose."""
    return np.array(
        [
            one.plan.target if np.isfinite(one.plan.target).all() else one.plan.goal_pose[:3]
            for one in motions
        ]
    ).reshape(-1, 3)


def demonstration_table(arm: ArmRecords, folder: Path) -> str:
    """Make one row a demonstration, sorted by click, with links to its exports.

    Parameters
    ----------
    arm : ArmRecords
    folder : Path
        Of the run.

    Returns
    -------
    str
        HTML.
    """
    motions = {motion.plan.name: motion for motion in arm.motions}
    header = ["demonstration", "duration [s]", "stretch", "position error [mm]"]
    header += ["orientation error [deg]"]
    if motions:
        header += [
            "imitation error, greatest [mm]",
            "miss, imitated [cm]",
            "miss, refined [cm]",
            "episodes",
            "success",
        ]
    if arm.robustness:
        from besman.report.robustness import ROBUSTNESS_HEADER, robustness_cells

        header += ROBUSTNESS_HEADER
    rows = []
    for trajectory in arm.mapping.trajectories:
        row = [
            html.escape(trajectory.name),
            f"{trajectory.time[-1]:.2f}",
            f"{trajectory.time_stretch:.2f}",
            f"{1000 * trajectory.position_error.mean():.1f}",
            f"{np.rad2deg(trajectory.orientation_error.mean()):.1f}",
        ]
        if motions:
            row += _motion_cells(motions.get(trajectory.name))
        if arm.robustness:
            row += robustness_cells(arm.robustness.get(trajectory.name))
        rows.append([*row, _links(trajectory.name, folder, f"exports{arm.suffix}")])
    return (
        f"<h2>Every demonstration{html.escape(arm.heading)}</h2>"
        + html_table([*header, "exports"], rows, sortable=True)
        + '<p class="soft">A click on a head sorts. Errors are means over the movement, but '
        "the imitation's is the tool's greatest distance from the mapped path at the same time; "
        "stretch is the robot's duration over the person's. Exports: joint trajectory as CSV, as "
        "ROS 2 message (JSON and YAML), as URScript; the way there from home.</p>"
    )


def _motion_cells(motion: RefinedMotion | None) -> list[str]:
    """Say what refinement made of a demonstration."""
    if motion is None:
        return [""] * 5
    tone, word = ("good", "yes") if motion.success else ("bad", "no")
    failed = html.escape(motion.failure) or "-"
    lost = motion.plan.path_error
    return [
        "-" if lost is None else f"{1000 * lost:.1f}",
        f"{100 * motion.miss_before:.1f}" if np.isfinite(motion.miss_before) else failed,
        f"{100 * motion.miss:.1f}" if np.isfinite(motion.miss) else "-",
        str(motion.simulations.sum()),
        f'<span class="{tone}">{word}</span>',
    ]


def _links(name: str, folder: Path, exports: str) -> str:
    """Link the files of one motion."""
    source, _, segment = name.rpartition(":")
    stem = f"{Path(source).stem}_{segment}"
    return " ".join(
        f'<a href="{html.escape(f"{exports}/{stem}{ending}")}">{word}</a>'
        for ending, word in _FORMATS
        if (folder / exports / f"{stem}{ending}").is_file()
    )


def captioned(drawing: str, caption: str, wide: bool = False) -> str:
    """Put a drawing and its caption (HTML) into a figure; a wide one scrolls on a phone."""
    inside = f'<div class="wide">{drawing}</div>' if wide else drawing
    return f"<figure>{inside}<figcaption>{caption}</figcaption></figure>"


def evenly(items: Sequence[Any], most: int) -> list[Any]:
    """Return all items, or of more than `most` as many evenly spaced in their order."""
    rows = np.linspace(0, len(items) - 1, min(most, len(items)))
    return [items[row] for row in np.rint(rows).astype(int)]


def _shown(n: int, what: str, most: int = _DRAWN) -> str:
    """Say that not all are drawn."""
    return "" if n <= most else f" Drawn are {most} of {n} {what}, evenly spaced in their order."
