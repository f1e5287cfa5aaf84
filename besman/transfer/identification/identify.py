"""From a run and the executions of its motions to a robot.yaml that says what the arm does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from besman.exceptions import RunError, TransferError
from besman.io.atomic_files import check_folder
from besman.pipeline.check_run import check_run
from besman.pipeline.finished_run import FinishedRun, read_run
from besman.pipeline.sealed_page import PAGE
from besman.transfer.identification.executions import as_movement, find_executions, read_logs
from besman.transfer.identification.fit import DriveFit, fit_drives
from besman.transfer.identification.identified_robot import place_of_identified, write_identified
from besman.transfer.identification.quantities import PAYLOAD
from besman.work.work import Work


@dataclass(frozen=True, eq=False)
class Identified:
    """What was found, and where it was written.

    Attributes
    ----------
    path : Path
        The new robot.yaml; a JSON file with all that was found is beside it.
    fit : DriveFit
    results : dict
        Content of that file.
    """

    path: Path
    fit: DriveFit
    results: dict[str, Any]


def identify_arm(
    run: Path,
    executions: Sequence[Path],
    motion: str | None = None,
    fit_start: bool = False,
    out: Path | None = None,
    work: Work = Work(),
) -> Identified:
    """Fit a run's arm to what it did, and write a robot.yaml beside the old one.

    Parameters
    ----------
    run : Path
        A finished run, whose exported motions were executed.
    executions : sequence of Path
        Logs, or folders of them; see `besman.io.executions.read_execution`.
    motion, fit_start
        As of `besman.transfer.identification.executions.read_logs`.
    out : Path, optional
        Folder to write to.
    work : Work
        Threads and progress.

    Raises
    ------
    RunError, RecordingError, TransferError, FileError
        If the folder is no finished run or was changed since it ended, a log cannot be used, or
        the logs tell nothing; then nothing is written.
    """
    finished = read_run(run)
    _refuse_changed(run)
    place = place_of_identified(finished.robot.source, run, out)
    check_folder(place[0].parent)
    paths = find_executions(executions)
    logs = read_logs(paths, finished.motions, finished.robot, motion, fit_start)
    movements = [as_movement(one) for one in finished.motions]
    fit = fit_drives(finished.robot, movements, logs, work.jobs, work.progress)
    if not fit.found.told.any():
        raise TransferError(
            f"{len(logs)} executions tell nothing of {finished.robot.name}: no quantity is known "
            "better than before; expected motions in which its joints move faster"
        )
    several = "" if len(logs) == 1 else "s"
    told_by = f"identified from {len(logs)} execution{several} of {run.resolve().name}"
    names = [finished.motions[log.movement].plan.name for log in logs]
    results = identification_results(finished, fit, list(zip(paths, names, strict=True)))
    write_identified(place, finished.robot.source, fit, told_by, results)
    return Identified(place[0], fit, results)


def _refuse_changed(run: Path) -> None:
    """Refuse a run that is not as it ended; of one without a ``run.json`` nobody knows."""
    if not (run / "run.json").is_file():
        return
    faults = [fault for fault in check_run(run)[1] if not fault.startswith(PAGE)]
    if faults:
        raise RunError(f"{run}: was changed since it ended: {faults[0]}; see: besman check {run}")


def identification_results(
    finished: FinishedRun, fit: DriveFit, logs: Sequence[tuple[Path, str]]
) -> dict[str, Any]:
    """Give what was found, for a JSON file.

    Parameters
    ----------
    finished : FinishedRun
    fit : DriveFit
    logs : sequence of pairs
        File, and name of its motion.

    Returns
    -------
    dict
        robot, tool, executions, n_samples; apart_rad {before, after}, root mean square of simulated
        minus logged angles; quantities: key, joint (null: the arm's), before, value, deviation
        (null: it has no effect), told. What is not told has its old value.
    """
    found = fit.found
    rows = zip(fit.quantities, fit.before, found.values, found.deviations, found.told, strict=True)
    return {
        "robot": finished.robot.name,
        "tool": finished.robot.tool.name,
        "executions": [{"file": path.name, "motion": name} for path, name in logs],
        "n_samples": fit.n_samples,
        "apart_rad": {"before": fit.apart_before, "after": fit.apart},
        "quantities": [
            {
                "key": one.key,
                "joint": None if one.joint < 0 else finished.robot.joint_names[one.joint],
                "before": float(before),
                "value": float(value),
                "deviation": float(deviation),
                "told": bool(told),
            }
            for one, before, value, deviation, told in rows
        ],
    }


def identification_lines(results: dict[str, Any]) -> list[str]:
    """Say what was found: a line for each joint, one for the payload, how far paths are apart."""
    rows: dict[str, list[dict[str, Any]]] = {}
    for one in results["quantities"]:
        rows.setdefault(one["joint"] or PAYLOAD, []).append(one)
    lines = []
    for name, quantities in rows.items():
        told = [_said(one) for one in quantities if one["told"]]
        vague = [one["key"] for one in quantities if not one["told"]]
        kept = f"left as before, not told: {', '.join(vague)}" if vague else ""
        lines.append(f"{name}: {'; '.join([*told, *([kept] if kept else [])])}")
    apart = results["apart_rad"]
    lines.append(
        f"simulated and logged angles apart: {1e3 * apart['before']:.2f} mrad before, "
        f"{1e3 * apart['after']:.2f} mrad now ({len(results['executions'])} executions, "
        f"{results['n_samples']} samples)"
    )
    return lines


def _said(one: dict[str, Any]) -> str:
    """Say what was found of one quantity."""
    return f"{one['key']} {one['before']:.4g} -> {one['value']:.4g} ± {one['deviation']:.2g}"
