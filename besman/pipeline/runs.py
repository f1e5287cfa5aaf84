"""The runs of a folder: what there is, what it takes, and what of it can go."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from besman.config.yaml_file import read_yaml
from besman.exceptions import ConfigError, RunError
from besman.io.atomic_files import remove_folder, says_where
from besman.pipeline.derived_files import stale_files
from besman.pipeline.run_lock import take_lock
from besman.pipeline.run_record import find_file_faults, find_leftovers
from besman.pipeline.stored_run import open_run


@dataclass(frozen=True)
class ListedRun:
    """One run of a folder.

    Attributes
    ----------
    folder : Path
    status : str
        ``done``, ``failed``, ``running``, ``killed``, or ``damaged``.
    recipe : str
        Its name, robot and task.
    n_bytes : int
        What it takes on the disk.
    error : str
        What stopped it.
    """

    folder: Path
    status: str
    recipe: str
    n_bytes: int
    error: str = ""


@dataclass(frozen=True)
class Removable:
    """What can go from a run folder.

    Attributes
    ----------
    path : Path
    n_bytes : int
    why : str
    """

    path: Path
    n_bytes: int
    why: str


def list_runs(folder: Path) -> tuple[ListedRun, ...]:
    """Return the runs in a folder, and below it in folders that are no runs, by their names.

    Raises
    ------
    RunError
        If there is no such folder.
    """
    if not folder.is_dir():
        raise RunError(f"{folder}: there is no such folder; expected a folder of runs")
    found: list[ListedRun] = []
    for place in sorted(path for path in folder.iterdir() if path.is_dir()):
        if (place / "run.json").exists():
            found.append(_describe(place))
        elif not place.name.startswith("."):
            # Of `besman retarget` to several robots.
            inside = sorted(path.parent for path in place.glob("*/run.json"))
            found += [_describe(one) for one in inside]
    return tuple(found)


def _describe(place: Path) -> ListedRun:
    """Say what a run is."""
    n_bytes = size_of(place)
    try:
        run = open_run(place)
    except RunError as error:
        return ListedRun(place, "damaged", "", n_bytes, str(error))
    words = [run.state["name"]]
    try:
        config, _ = read_yaml(place / "pipeline.yaml")
    except ConfigError:
        config = {}
    words += [str(config[key]) for key in ("robot", "task") if key in config]
    return ListedRun(place, run.status, ", ".join(words), n_bytes, run.state.get("error") or "")


def find_removable(folder: Path) -> tuple[Removable, ...]:
    """Return what lies in a run folder and is no part of the run.

    Parameters
    ----------
    folder : Path
        A run that is done: one that is not may go on with what lies there.

    Raises
    ------
    RunError
        If the folder is not a run, or the run is not done.
    """
    run = open_run(folder)
    if run.status != "done":
        raise RunError(
            f"{folder}: the run is not done (status {run.status!r}) and may go on with what lies "
            "here; run it to its end first, or remove the folder"
        )
    names = [place.name for place in run.stages.values()]
    found = {path: "is no part of this run" for path in find_leftovers(folder, names)}
    found |= {path: "was left half written" for path in folder.glob(".*.tmp*")}
    for name, one in run.state.get("exports", {}).items():
        for fault in find_file_faults(folder / name, one["files"]):
            path, _, why = fault.partition(" ")
            if why == "is no part of this run":
                found[folder / path] = why
    found |= {folder / name: "shows other motions" for name in stale_files(run)}
    return tuple(Removable(path, size_of(path), why) for path, why in sorted(found.items()))


def remove(folder: Path, removable: tuple[Removable, ...]) -> None:
    """Remove what `find_removable` found.

    Raises
    ------
    RunError, FileError
        If a process is working in the run folder, or something cannot be removed.
    """
    with take_lock(folder):
        for one in removable:
            if one.path.is_dir():
                remove_folder(one.path)
            else:
                with says_where(one.path):
                    one.path.unlink(missing_ok=True)


def size_of(path: Path) -> int:
    """Return how many bytes a file, or all files below a folder, take."""
    files = [path] if path.is_file() else path.rglob("*")
    return sum(file.lstat().st_size for file in files if file.is_file() or file.is_symlink())
