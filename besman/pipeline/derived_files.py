"""Videos and replays of a run: which of them show the motions that it holds now."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from besman.exceptions import RunError
from besman.io.atomic_files import write_json
from besman.pipeline.stage_store import checksum
from besman.pipeline.stored_run import StoredRun, open_run, read_object
from besman.records.files import digest

_LIST = "shown.json"


def note_file(folder: Path, path: Path) -> None:
    """Note of what a file was made, if it lies in a run folder.

    Parameters
    ----------
    folder : Path
        The run.
    path : Path
        The file.
    """
    if path.resolve().parent != folder.resolve():
        return
    made = {"of": _motions(open_run(folder)), "sha256": checksum(path)}
    listed = _listed(folder) | {path.name: made}
    write_json(folder / _LIST, {name: listed[name] for name in sorted(listed)})


def stale_files(run: StoredRun) -> list[str]:
    """Return the names of the files that were made of other motions than a run holds.

    Of files that nobody noted nothing is known; they count as current.
    """
    of = _motions(run)
    return [
        name
        for name, one in _listed(run.folder).items()
        if (run.folder / name).is_file()
        and one["of"] != of
        and one["sha256"] == checksum(run.folder / name)
    ]


def _motions(run: StoredRun) -> str:
    """Return a digest of what a run shows in motion."""
    stages = ("label", "select", "map", "refine", "refine_second")
    return digest({name: run.checksum(name) for name in stages})


def _listed(folder: Path) -> dict[str, Any]:
    """Return what was noted; nothing where that cannot be read."""
    try:
        listed = read_object(folder / _LIST)
    except RunError:
        return {}
    return {
        name: one
        for name, one in listed.items()
        if isinstance(one, dict) and one.keys() == {"of", "sha256"} and "/" not in name
    }
