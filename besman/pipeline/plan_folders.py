"""Plans that were made from a run, in folders of their own: whether they are whole and its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from besman.exceptions import RunError
from besman.pipeline.run_record import find_file_faults
from besman.pipeline.stored_run import StoredRun, read_object
from besman.records.files import digest

FOLDER, PLAN = "plans", "plan.json"
"""Where they stand in a run folder, and what says in each what it holds."""


def plans_made_of(run: StoredRun) -> str:
    """Return a digest of all that plans depend on in a run."""
    stages = ("task_plans", "simulate")
    return digest({name: run.checksum(name) for name in stages})


def plan_folders(folder: Path) -> list[Path]:
    """Return the folders of a run's plans, by their names."""
    return sorted(path.parent for path in (folder / FOLDER).glob(f"*/{PLAN}"))


def plan_faults(run: StoredRun) -> list[str]:
    """Say what is missing, cut or foreign in the plans of a run, or not of what it holds."""
    of, faults = plans_made_of(run), []
    for folder in plan_folders(run.folder):
        name = f"{FOLDER}/{folder.name}"
        try:
            made = read_object(folder / PLAN)
        except RunError as error:
            faults.append(str(error))
            continue
        if not _is_whole(made):
            faults.append(f"{name}/{PLAN} is not as besman writes it; besman plan makes another")
            continue
        found = find_file_faults(folder, made["files"])
        faults += [f"{FOLDER}/{one}" for one in found]
        if made["of"] != of:
            faults.append(f"{name} is made of other tasks than the run holds")
    return faults


def _is_whole(made: dict[str, Any]) -> bool:
    """Tell whether what a plan says of its files can be used."""
    files = made.get("files")
    return (
        isinstance(made.get("of"), str)
        and isinstance(files, dict)
        and all(isinstance(one, str) and "/" not in name for name, one in files.items())
    )
