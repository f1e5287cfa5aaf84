"""The report in the terminal."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from besman.pipeline.stored_run import StoredRun, open_run
from besman.report.centimetres import centimetres
from besman.report.timing import seconds, stage_rows

if TYPE_CHECKING:
    from rich.console import Console

# Failures of a stage that are listed in the terminal.
_SHOWN = 3
_WIDE = 1000  # characters; more than any table needs


def print_report(folder: Path, console: Console) -> None:
    """Print the stage table and the outcome of a run.

    Parameters
    ----------
    folder : Path
        A run folder.
    console : rich.console.Console
        Where to print.

    Raises
    ------
    RunError
        If the folder is not a run.
    """
    run = open_run(folder)
    with run.reading():
        _print(run, console)


def _print(run: StoredRun, console: Console) -> None:
    from rich.box import SIMPLE
    from rich.table import Table

    timing, results = run.read("timing.json"), run.read("results.json")
    n = results.get("map", {}).get("n_demonstrations", 0)
    table = Table(
        title=f"{run.state['name']}: {run.status}", caption=_caption(n), box=SIMPLE, pad_edge=False
    )

    table.add_column("stage", no_wrap=True)
    for name in ("wall", "CPU", "items", "each", "thesis"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("by", no_wrap=True)
    for row in stage_rows(timing, n):
        table.add_row(
            row["name"],
            seconds(row["wall_s"]),
            seconds(row["cpu_s"]),
            f"{row['items']} {row['unit']}" if row["items"] else "",
            seconds(row["per_item_s"]) if row["per_item_s"] is not None else "",
            seconds(row["thesis_s"]) if row["thesis_s"] is not None else "",
            "cached" if row["cached"] else "human" if row["human"] else "machine",
        )
    table.add_section()
    table.add_row("total", seconds(timing["total_wall_s"]))
    unbound = console.options.update(max_width=_WIDE)
    if console.measure(table, options=unbound).maximum > console.width:
        table.padding = 0  # no cell is cut
    console.print(table)
    for line in [*outcome_lines(results), *failure_lines(results), _memory_line(timing)]:
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _caption(n: int) -> str:
    return (
        f"thesis: table 7.1, scaled to {n} demonstrations; its imitation covers select, map and "
        "imitate"
    )


def _memory_line(timing: dict[str, Any]) -> str:
    """Say the greatest memory of each process."""
    own = max((row["peak_rss_mb"] for row in timing["stages"]), default=0.0)
    workers = [row["workers"] for row in timing["stages"] if row.get("workers", {}).get("n")]
    if not workers:
        return f"memory: {own:.0f} MB"
    most = max(one["peak_rss_mb"] for one in workers)
    return f"memory: {own:.0f} MB, and at most {most:.0f} MB each worker process"


def outcome_lines(results: dict[str, Any]) -> list[str]:
    """Say in a few lines what a run found.

    Parameters
    ----------
    results : dict
        Content of ``results.json``.

    Returns
    -------
    list of str
    """
    lines = []
    label = results.get("label", {})
    if "names" in label:
        lines.append(f"marker names: {_names(label['names'])}")
    if "right_share" in label:
        lines.append(
            f"labelling: {label['right_share']:.2%} of the marker samples named right, "
            f"{label['wrong_share']:.2%} wrong, {len(label['review'])} trajectories for review"
        )
    segment = results.get("segment", {})
    if "f1" in segment:
        lines.append(
            f"segmentation: F1 {segment['f1']:.3f} against the manual segments "
            f"(margin {segment['margin_s']:g} s), median border offset "
            f"{segment['median_offset_s']:.3f} s"
        )
    recognize = results.get("recognize", {})
    if recognize.get("accuracy") is not None:
        lines.append(
            f"recognition: {recognize['accuracy']:.1%} of the detected segments, "
            f"{recognize['accuracy_manual']:.1%} of the manual segments"
            + left_out(recognize.get("n_left_out", 0))
        )
    told = Counter(results.get("select", {}).get("target", {}).values())
    if told and set(told) != {"object"}:
        lines.append("targets: " + ", ".join(f"{n} by {source}" for source, n in told.items()))
    for suffix, arm in (("", ""), ("_second", "second arm, ")):
        lines += [arm + line for line in _arm_lines(results, suffix)]
    return lines


def _names(recordings: list[dict[str, Any]]) -> str:
    """Say how many markers recordings named themselves, and how many were found."""
    taken = sum(one["taken"] for one in recordings)
    found = sum(one["found"] for one in recordings)
    said = f"{taken} taken from the recordings" if taken or not found else ""
    if found:
        said += f"{', ' if said else ''}{found} found among trajectories without names"
    return said


def _arm_lines(results: dict[str, Any], suffix: str) -> list[str]:
    """Say what came of mapping and refinement of one arm."""
    lines = []
    mapped = results.get(f"map{suffix}", {})
    if mapped:
        error = mapped["position_error_m"]
        lines.append(
            f"mapping: {mapped['n_transferred']} of {mapped['n_demonstrations']} demonstrations, "
            f"position error mean {1000 * error['mean']:.1f} mm, max {1000 * error['max']:.1f} mm, "
            f"{mapped['limit_violations']} samples outside a limit, "
            f"{mapped['self_collisions']} in self-collision"
        )
    for stage, what in ((f"task_plans{suffix}", "block by block"), (f"imitate{suffix}", "")):
        imitate = results.get(stage, {})
        if imitate.get("position_error_m", {}).get("max") is not None:
            lines.append(_imitation(imitate, what))
    for stage, how in (("simulate", "imitation only"), ("refine_tasks", "refined")):
        if not suffix and stage in results:
            lines.append(_simulation(results[stage], how))
    refine = results.get(f"refine{suffix}", {})
    shared = refine.get("episodes_shared")
    if refine:
        lines.append(
            f"refinement: {refine['n_success']} of {refine['n_motions']} succeed, miss "
            f"{centimetres(refine['miss_before_m']['median'], 'unknown')} before, "
            f"{centimetres(refine['miss_m']['median'], 'unknown')} after (medians), "
            f"{refine['episodes']['median']:g} episode"
            f"{'s' if refine['episodes']['median'] != 1 else ''}"
            + (f" ({shared} more that all share)" if shared else "")
        )
    for why, n in Counter(refine.get("handed_over", {}).values()).items():
        lines.append(f"refinement: {n} of {refine['n_motions']} by CMA-ES in the end: {why}")
    if refine.get("robustness"):
        lines.append(robustness_line(refine["robustness"]))
    for folder in (f"exports{suffix}", *(() if suffix else ("exports_tasks",))):
        lines += _withheld(results.get(folder, {}))
    return lines


def _withheld(exported: dict[str, Any]) -> list[str]:
    """Say which motions no arm is given."""
    withheld = exported.get("withheld", {})
    shown = [f"{name} ({why})" for name, why in list(withheld.items())[:_SHOWN]]
    more = f" and {len(withheld) - _SHOWN} more" if len(withheld) > _SHOWN else ""
    n = f"{len(withheld)} of {exported['n_motions']}" if withheld else ""
    return [f"warning: {n} not exported: {', '.join(shown)}{more}"] if withheld else []


def _simulation(found: dict[str, Any], how: str) -> str:
    """Say how many whole tasks succeed in simulation, and why others fail."""
    line = (
        f"whole tasks, {how}: {found['n_success']} of {found['n_tasks']} succeed in simulation, "
        f"within {100 * found['success_radius_m']:g} cm and {found['success_angle_deg']:g} degrees"
    )
    if found["miss_m"]["median"] is not None:
        line += f"; miss {centimetres(found['miss_m']['median'], 'unknown')} (median)"
    failed = [one["failure"] for one in found["trials"].values() if not one["success"]]
    whys = Counter(failure.partition(":")[0] or "beside its place" for failure in failed)
    whys["out of reach"] = found["n_tasks"] - found["n_tried"]
    parts = [f"{n} {why}" for why, n in whys.most_common() if n]
    return "; ".join([line, ", ".join(parts)]) if parts else line


def _imitation(found: dict[str, Any], what: str) -> str:
    """Say how far the imitations' tool is from the mapped path, and of which it is too far."""
    error, numbers = found["position_error_m"], found["n_weights"]
    weights = " to ".join(str(number) for number in sorted(set(numbers.values())))
    rms = f"rms {1000 * error['rms']:.1f} mm, " if "rms" in error else ""
    line = (
        f"imitation{f' {what}' if what else ''}: position error at the same time {rms}"
        f"max {1000 * error['max']:.1f} mm, {weights} weights"
    )
    beyond = found["beyond"]
    if not beyond:
        return line
    more = f" and {len(beyond) - _SHOWN} more" if len(beyond) > _SHOWN else ""
    return (
        f"{line}; warning: {len(beyond)} beyond {1000 * found['wanted_error_m']:g} mm: "
        f"{', '.join(beyond[:_SHOWN])}{more}"
    )


def robustness_line(found: dict[str, Any]) -> str:
    """Say how refined motions stand perturbed models and a finer time step.

    Parameters
    ----------
    found : dict
        What `besman.stages.refine.robustness.robustness_results` gave.
    """
    share, shift = found["success_share"], found["shift_at_quarter_step_m"]["median"]
    parts = []
    if share is not None:
        parts.append(f"{share:.0%} succeed in {found['models']} perturbed models each")
    if found["miss_m"]["median"] is not None:
        parts[-1] += (
            f", miss {100 * found['miss_m']['median']:.1f} cm (median), "
            f"{100 * found['miss_m']['p95']:.1f} cm (95 %)"
        )
    if shift is not None:
        parts.append(f"{100 * shift:.1f} cm elsewhere at a quarter of the time step (median)")
    return "robustness: " + "; ".join(parts)


def failure_lines(results: dict[str, Any]) -> list[str]:
    """Say what every stage left out, and of the first few why.

    Parameters
    ----------
    results : dict
        Content of ``results.json``.

    Returns
    -------
    list of str
    """
    lines = []
    for stage, failed in failures(results).items():
        lines.append(f"{stage}: {len(failed)} left out")
        lines += [f"  {one['name']}: {one['reason']}" for one in failed[:_SHOWN]]
        if len(failed) > _SHOWN:
            lines.append(f"  and {len(failed) - _SHOWN} more, see results.json")
    return lines


def failures(results: dict[str, Any]) -> dict[str, list[dict[str, str]]]:
    """Return name and reason of everything that was left out, by stage."""
    found = {stage: content.get("failed") for stage, content in results.items()}
    return {stage: failed for stage, failed in found.items() if failed}


def _number(value: float | None) -> float:
    """Return NaN for a figure that JSON holds as null."""
    return float("nan") if value is None else value


def left_out(n: int) -> str:
    """Say how many stretches of the recordings recognition was not measured on."""
    return f"; {n} unlabelled, in which the hand moves, left out" if n else ""
