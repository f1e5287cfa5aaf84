"""What a run writes about itself: ``run.json``, ``results.json``, ``timing.json``, ``log.txt``."""

from __future__ import annotations

import os
import platform
import time
from pathlib import Path
from typing import Any

from besman.exceptions import RunError
from besman.io.atomic_files import remove_folder, says_where, write_json, write_record, write_text
from besman.pipeline.sealed_page import PAGE
from besman.pipeline.stage_store import checksum
from besman.pipeline.stored_run import FILES, is_stage_folder, open_run
from besman.records.files import digest
from besman.stages.export.motion_exports import is_export
from besman.work.versions import commit, library_versions

# Made of the stages' records by a command that is run again in no time.
_DRAWN = (PAGE, "figures.json", "overview.svg", "overview_second.svg")


class RunRecord:
    """The account that a run gives of itself.

    Whatever it was before, a folder shows nothing of another recipe from the moment that a run
    begins: the account names the stages that are done, and exports and report of another recipe
    go.

    Parameters
    ----------
    folder : Path
        The run folder, taken by `besman.pipeline.run_lock.take_lock`.
    name : str
        Of the pipeline.
    code : str
        Digest of besman's code.

    Attributes
    ----------
    results : dict
        For ``results.json``.
    timing : list of dict
        Rows of ``timing.json``.
    """

    def __init__(self, folder: Path, name: str, code: str) -> None:
        self.folder, self.name, self._code = folder, name, code
        self.results: dict[str, Any] = {}
        self.timing: list[dict[str, Any]] = []
        self._state: dict[str, Any] = {}
        self._started = time.perf_counter()

    def begin(self, pipeline_yaml: str, inputs: dict[str, str]) -> None:
        """Write what is known before the first stage: config and provenance.

        Parameters
        ----------
        pipeline_yaml : str
            The resolved config.
        inputs : dict
            SHA-256 of every input file by its name.
        """
        versions = library_versions()
        recipe = digest((pipeline_yaml, sorted(inputs.items()), self._code, versions))
        before = self._before()
        same = before.get("recipe") == recipe
        if not same:
            self._remove_shown()
        self._state = {
            "name": self.name,
            "versions": versions,
            "commit": commit(),
            "code": self._code,
            "machine": {
                "system": platform.platform(),
                "processor": platform.processor() or platform.machine(),
                "cores": os.cpu_count(),
            },
            "inputs": inputs,
            "recipe": recipe,
            "stages": [],
            "exports": before.get("exports", {}) if same else {},
        }
        self._write_state("running")
        write_text(self.folder / "pipeline.yaml", pipeline_yaml)
        self.write_figures()
        self.log(f"run {self.name} started")

    def _before(self) -> dict[str, Any]:
        """Return what the run before this one said of itself."""
        if not (self.folder / "run.json").exists():
            return {}
        try:
            return open_run(self.folder).state
        except RunError as error:
            self.log(f"what was here before cannot be read: {error}")
            return {}

    def _remove_shown(self) -> None:
        """Remove what shows another recipe's results."""
        for name in _DRAWN:
            path = self.folder / name
            with says_where(path):
                path.unlink(missing_ok=True)
        for exports in self.folder.glob("exports*"):
            if exports.is_dir():
                remove_exports(exports)

    def keep_truth(self, blocks: Any) -> None:
        """Write what the figures are held against."""
        write_record(self.folder / "truth.npz", blocks)

    def add_stage(self, row: dict[str, Any], place: Path, n_failed: int) -> None:
        """List a stage that is done, once its figures are written.

        Parameters
        ----------
        row : dict
            Of the timing table.
        place : Path
            The stage's folder.
        n_failed : int
            How many items it left out.
        """
        self.add_timing(row, n_failed)
        self._state["stages"].append(place.name)
        self._write_state("running")

    def add_exports(self, folder: Path, of: str) -> None:
        """List what was exported, with the digest of every file.

        Parameters
        ----------
        folder : Path
        of : str
            Digest of what the exports depend on.
        """
        files = {path.name: checksum(path) for path in sorted(folder.iterdir()) if is_export(path)}
        self._state["exports"][folder.name] = {"of": of, "files": files}
        self._write_state("running")

    def fault_of_exports(self, folder: Path, of: str) -> str | None:
        """Say why exports have to be written, if they are not whole and current.

        Parameters
        ----------
        folder, of
            As of `add_exports`.

        Returns
        -------
        str or None
            Empty where there are none yet.
        """
        listed = self._state["exports"].get(folder.name)
        if listed is None or listed["of"] != of:
            return ""
        return next(iter(find_file_faults(folder, listed["files"])), None)

    def add_timing(self, row: dict[str, Any], n_failed: int = 0) -> None:
        """Add a row to the timing table."""
        self.timing.append(row)
        self.write_figures()
        cached, failed = "cached, " * row["cached"], f", {n_failed} failed" * (n_failed > 0)
        spent = f"{row['wall_s']:.2f} s, {row['items']} {row['unit']}"
        self.log(f"{row['name']}: {cached}{spent}{failed}")

    def write_figures(self) -> None:
        """Write what is known so far."""
        total = time.perf_counter() - self._started
        timing = {"total_wall_s": total, "stages": self.timing}
        for name, content in (("results.json", self.results), ("timing.json", timing)):
            # The last state has their digests: what a failing power cuts is noticed.
            write_json(self.folder / name, content, durable=False)

    def end(self, status: str, error: str | None) -> None:
        """Write the last state; after a good end remove what is no part of this run."""
        self.write_figures()
        if status == "done":
            self._remove_leftovers()
        there = [self.folder / name for name in FILES]
        self._state["files"] = {path.name: checksum(path) for path in there if path.is_file()}
        self._write_state(status, error)
        self.log(f"run {status}" + (f": {error}" if error else ""))

    def _remove_leftovers(self) -> None:
        for place in find_leftovers(self.folder, self._state["stages"]):
            remove_folder(place)
            self.log(f"{place.name}: removed: it is no part of this run")

    def log(self, line: str) -> None:
        """Add a line to ``log.txt``."""
        path = self.folder / "log.txt"
        with says_where(path), path.open("a", encoding="utf-8") as file:
            file.write(f"{time.strftime('%Y-%m-%dT%H:%M:%S%z')} {' '.join(line.splitlines())}\n")

    def _write_state(self, status: str, error: str | None = None) -> None:
        write_json(self.folder / "run.json", {"status": status, "error": error, **self._state})


def find_leftovers(folder: Path, stages: list[str]) -> list[Path]:
    """Return stage folders and half-made ones that are no part of a run.

    Parameters
    ----------
    folder : Path
        The run folder.
    stages : list of str
        Names of the folders that are.
    """
    hidden = [path for path in folder.glob(".[0-9][0-9]_*") if path.is_dir()]
    others = [path for path in folder.glob("[0-9][0-9]*") if is_stage_folder(path)]
    return sorted(hidden + [path for path in others if path.name not in stages])


def find_file_faults(folder: Path, files: dict[str, str]) -> list[str]:
    """Say what is missing, cut or foreign in a folder of exports.

    Parameters
    ----------
    folder : Path
    files : dict of str
        Digest of every file that belongs there.
    """
    faults = []
    for name, written in files.items():
        path = folder / name
        if not path.is_file():
            faults.append(f"{folder.name}/{name} is missing")
        elif checksum(path) != written:
            faults.append(f"{folder.name}/{name} is cut or changed")
    there = sorted(folder.iterdir()) if folder.is_dir() else []
    strange = [path.name for path in there if is_export(path) and path.name not in files]
    return faults + [f"{folder.name}/{name} is no part of this run" for name in strange]


def remove_exports(folder: Path) -> None:
    """Remove exports; what else lies in their folder stays."""
    with says_where(folder):
        for path in folder.iterdir():
            if is_export(path):
                path.unlink()
        if not any(folder.iterdir()):
            folder.rmdir()
