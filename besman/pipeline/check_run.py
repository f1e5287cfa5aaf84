"""What is missing, cut or foreign in a run folder."""

from __future__ import annotations

from pathlib import Path

from besman.exceptions import RunError
from besman.pipeline.derived_files import stale_files
from besman.pipeline.plan_folders import plan_faults, plan_folders
from besman.pipeline.run_record import find_file_faults, find_leftovers
from besman.pipeline.sealed_page import PAGE, fault_of_page
from besman.pipeline.stage_store import DamageError, check_record, read_description
from besman.pipeline.stored_run import StoredRun, open_run


def check_run(folder: Path) -> tuple[list[str], list[str]]:
    """Check stages, figures, exports and report of a run against what it wrote.

    Parameters
    ----------
    folder : Path
        A run folder.

    Returns
    -------
    whole : list of str
        One line for each part that is as it was written.
    faults : list of str
        One line for each thing that is not.

    Raises
    ------
    RunError
        If the folder is not a run, a process is working in it, or ``run.json`` is damaged.
    """
    run = open_run(folder)
    if run.status == "running":
        raise RunError(f"{folder}: another besman is working here; wait until it has ended")
    whole, faults = [], []
    if run.status != "done":
        error = run.state.get("error")
        faults.append(f"status: {run.status}{f': {error}' if error else ''}")
    parts = {
        f"stages: {len(run.stages)}": _stage_faults(run),
        "figures, truth, recipe": _file_faults(run),
        _exports_title(run): _export_faults(run),
        **_plans(run),
        "report": _page_faults(run),
        "nothing of another recipe": _foreign(run),
    }
    for title, found in parts.items():
        if found:
            faults += found
        else:
            whole.append(f"{title}: whole" if "nothing" not in title else title)
    return whole, faults


def _stage_faults(run: StoredRun) -> list[str]:
    """Say which stages are not as they were stored."""
    faults = []
    for place in run.stages.values():
        try:
            check_record(place, read_description(place))
        except DamageError as damage:
            faults.append(f"{place.name}: {damage}")
    return faults


def _file_faults(run: StoredRun) -> list[str]:
    """Say which files beside the stages are not as the run wrote them."""
    if run.status != "done":
        # Only an end that came in order has their digests.
        return []
    if "files" not in run.state:
        return ["run.json: names no digests: an older besman wrote it"]
    return [
        f"{name} is {'cut or changed' if (run.folder / name).is_file() else 'missing'}"
        for name in run.changed()
    ]


def _plans(run: StoredRun) -> dict[str, list[str]]:
    """Say how many plans were made of the run, and what is wrong with them."""
    n_plans = len(plan_folders(run.folder))
    return {f"plans: {n_plans}": plan_faults(run)} if n_plans else {}


def _exports_title(run: StoredRun) -> str:
    n_files = sum(len(one["files"]) for one in run.state.get("exports", {}).values())
    return f"exports: {n_files} files"


def _export_faults(run: StoredRun) -> list[str]:
    """Say what is wrong with the files for the arm."""
    listed = run.state.get("exports", {})
    others = [place for place in run.folder.glob("exports*") if place.name not in listed]
    files = {name: one["files"] for name, one in listed.items()}
    files |= {place.name: {} for place in others if place.is_dir()}
    return [fault for name in files for fault in find_file_faults(run.folder / name, files[name])]


def _page_faults(run: StoredRun) -> list[str]:
    """Say what is wrong with the report."""
    path = run.folder / PAGE
    if not path.is_file():
        missing = run.status == "done"
        return [f"{PAGE} is missing; besman report writes it"] if missing else []
    fault = fault_of_page(path, run.fingerprint())
    return [f"{PAGE} {fault}; besman report writes it anew"] if fault else []


def _foreign(run: StoredRun) -> list[str]:
    """Say what belongs to another recipe."""
    names = [place.name for place in run.stages.values()]
    left = find_leftovers(run.folder, names) if run.status == "done" else []
    return [
        *(f"{place.name} is no part of this run" for place in left),
        *(f"{name} shows other motions than the run holds" for name in stale_files(run)),
    ]
