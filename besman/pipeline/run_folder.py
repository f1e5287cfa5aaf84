"""The run folder: cached stages, timing, provenance. A crash leaves no half stage."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import platform
import shutil
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from besman.config.stage import Step, Truth
from besman.exceptions import RunError
from besman.io.atomic_files import write_json, write_text
from besman.records import Failure
from besman.records.files import digest, load_record, save_record
from besman.work.display import Display
from besman.work.in_worker import peak_rss_mb
from besman.work.outcome import Notes
from besman.work.versions import code_version, commit, library_versions
from besman.work.work import Work
from besman.work.workers import Workers

Records = ParamSpec("Records")
Result = TypeVar("Result")


class Run:
    """One run folder.

    Parameters
    ----------
    folder : Path
        Made if it is not there. An existing folder must be a run.
    name : str
        Name of the pipeline.
    jobs : int
        Threads that a stage may use; never changes a result.
    fresh : str, optional
        Stage to compute again although it is cached, and with it all that follows from it.
    display : callable, optional
        Shows progress; see `Display`.
    workers : Workers, optional
        Processes or a cluster; without them there are threads alone.

    Attributes
    ----------
    truth : Truth
        What the figures of the stages are held against.
    results : dict
        Those figures, for ``results.json``.

    Raises
    ------
    RunError
        If the folder holds something else, or another process is using it.
    """

    def __init__(
        self,
        folder: Path,
        name: str,
        jobs: int = 1,
        fresh: str | None = None,
        display: Display | None = None,
        workers: Workers | None = None,
    ) -> None:
        if folder.exists() and not folder.is_dir():
            raise RunError(f"{folder}: is a file; expected a run folder or a new name for --out")
        strange = folder.is_dir() and any(folder.iterdir()) and not (folder / "run.json").exists()
        if strange and not (folder / ".lock").exists():
            raise RunError(f"{folder}: is not empty and not a run; give a new name with --out")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RunError(f"{folder}: cannot be made: {error.strerror}") from None
        self.folder = folder
        self.name = name
        self.jobs = jobs
        self.fresh = fresh
        self.truth = Truth()
        self.results: dict[str, Any] = {}
        self.timing: list[dict[str, Any]] = []
        self._failed: dict[str, list[Failure]] = {}
        self._workers = workers
        self._display = display
        self._code = code_version()
        self._started = time.perf_counter()
        self._lock = _lock(folder / ".lock")

    def start(self, pipeline_yaml: str, inputs: dict[str, str]) -> None:
        """Write what is known before the first stage: config and provenance.

        Parameters
        ----------
        pipeline_yaml : str
            The resolved config.
        inputs : dict
            SHA-256 of every input file by its name.
        """
        write_text(self.folder / "pipeline.yaml", pipeline_yaml)
        self._provenance = {
            "name": self.name,
            "versions": library_versions(),
            "commit": commit(),
            "code": self._code,
            "machine": {
                "system": platform.platform(),
                "processor": platform.processor() or platform.machine(),
                "cores": os.cpu_count(),
            },
            "inputs": inputs,
        }
        self._status("running")
        self.log(f"run {self.name} started")

    def step(
        self,
        name: str,
        stage: Step[Records, Result],
        /,
        *records: Records.args,
        **named: Records.kwargs,
    ) -> Result:
        """Run a stage as `prepare` does, and take its figures into the results.

        Parameters
        ----------
        name, stage, *records, **named
            As of `prepare`.

        Returns
        -------
        record or tuple of records
        """
        result = self.prepare(name, stage, *records, **named)
        figures = stage.figures(result, self.truth, *records)
        left_out = {}
        if stage.config.leaves_out:
            left_out = {"failed": [asdict(one) for one in self._failed[name]]}
        sections = figures if isinstance(figures, tuple) else (figures,)
        for section, arm in zip(sections, ("", "_second"), strict=False):
            if section:
                self.results[f"{name}{arm}"] = section | left_out
        return result

    def prepare(
        self,
        name: str,
        stage: Step[Records, Result],
        /,
        *records: Records.args,
        **named: Records.kwargs,
    ) -> Result:
        """Run a stage, or load its result if config, code and input are the same as before.

        Parameters
        ----------
        name : str
            Name of the stage; its folder is ``NN_name``.
        stage : Step
            Says what to do.
        *records
            What its ``run`` gets.
        **named
            None: everything is given by its place.

        Returns
        -------
        record or tuple of records
        """
        assert not named
        config, items = stage.config, stage.items(*records)
        place = self.folder / f"{len(self.timing):02d}_{name}"
        kind = type(stage).__name__
        key = digest((config, kind, self._code, tuple(_content(record) for record in records)))
        wall, cpu = time.perf_counter(), _cpu_seconds()
        before = None if name == self.fresh else _stored(place, key)
        notes = Notes()
        if before is not None:
            result: Result = load_record(place / "record.npz")
            computed = before["wall_s"]
            notes.failures = [Failure(**one) for one in before["failed"]]
        else:
            going = self.folder / f".{place.name}.going"
            kept = self._checkpoints(going, key, name) if config.keeps_checkpoints else None
            result = self.work(name, stage.run, *records, notes=notes, checkpoints=kept)
            computed = time.perf_counter() - wall
            _store(
                place,
                result,
                {
                    "key": key,
                    "method": getattr(config, "method", ""),
                    "config": config.model_dump(mode="json"),
                    "wall_s": computed,
                    "failed": [asdict(one) for one in notes.failures],
                },
            )
            shutil.rmtree(going, ignore_errors=True)
        self._failed[name] = notes.failures
        self.record_time(
            name,
            wall,
            cpu,
            items=items.n,
            unit=items.unit,
            cached=before is not None,
            computed=computed,
            notes=notes,
        )
        return result

    def _checkpoints(self, going: Path, key: str, name: str) -> Path:
        """Return the folder of a stage's checkpoints; those of another config or input go."""
        own = going / key[:16]
        for other in going.glob("*"):
            if other != own or name == self.fresh:
                shutil.rmtree(other, ignore_errors=True)
        own.mkdir(parents=True, exist_ok=True)
        return own

    def work(
        self,
        name: str,
        function: Callable[..., Result],
        *records: Any,
        notes: Notes | None = None,
        checkpoints: Path | None = None,
    ) -> Result:
        """Call a function with the run's threads and workers, and its progress shown.

        Parameters
        ----------
        name : str
            What is shown beside the progress.
        function : callable
            Takes the records and ``work``.
        *records
        notes : Notes, optional
            Takes what fails; without them the first failure is raised.
        checkpoints : Path, optional
            See `Work`.

        Returns
        -------
        any
            What the function returns.
        """
        progress, end = (
            self._display(name) if self._display else (lambda done: None, lambda ok: None)
        )
        finished = False
        try:
            work = Work(self.jobs, progress, notes, self._workers, checkpoints)
            result = function(*records, work=work)
            finished = True
        finally:
            end(finished)
        return result

    def record_time(
        self,
        name: str,
        wall: float,
        cpu: float,
        *,
        items: int = 0,
        unit: str = "item",
        cached: bool = False,
        computed: float | None = None,
        human: bool = False,
        notes: Notes | None = None,
    ) -> None:
        """Add a row to the timing table.

        Parameters
        ----------
        name : str
            Name of the stage.
        wall, cpu : float
            `time.perf_counter` and CPU seconds when it started.
        items, unit : int, str
            How many of what were worked on.
        cached : bool
            Whether the result was loaded.
        computed : float, optional
            Wall seconds that the computation took when it was made.
        human : bool
            Whether a person did it.
        notes : Notes, optional
            Account of worker processes.
        """
        spent = time.perf_counter() - wall
        notes = Notes() if notes is None else notes
        row = {
            "name": name,
            "wall_s": spent,
            "cpu_s": _cpu_seconds() - cpu + notes.cpu_s,
            "human": human,
            "items": items,
            "unit": unit,
            "cached": cached,
            "computed_wall_s": spent if computed is None else computed,
            "peak_rss_mb": peak_rss_mb(),
            "workers": {
                "n": len(notes.workers),
                "peak_rss_mb": max(notes.workers.values(), default=None),
            },
        }
        self.timing.append(row)
        self._write_timing()
        left_out = f", {len(notes.failures)} failed" if notes.failures else ""
        self.log(f"{name}: {'cached, ' if cached else ''}{spent:.2f} s, {items} {unit}{left_out}")

    def finish(self, status: str = "done", error: str | None = None) -> None:
        """Write results, timing and status, and let go of the folder."""
        write_json(self.folder / "results.json", self.results)
        self._write_timing()
        self._status(status, error)
        self.log(f"run {status}" + (f": {error}" if error else ""))
        self._lock.close()

    def log(self, line: str) -> None:
        """Add a line to ``log.txt``."""
        with (self.folder / "log.txt").open("a", encoding="utf-8") as file:
            file.write(f"{time.strftime('%Y-%m-%dT%H:%M:%S%z')} {line}\n")

    def _write_timing(self) -> None:
        total = time.perf_counter() - self._started
        write_json(self.folder / "timing.json", {"total_wall_s": total, "stages": self.timing})

    def _status(self, status: str, error: str | None = None) -> None:
        write_json(self.folder / "run.json", {"status": status, "error": error, **self._provenance})


def _content(record: Any) -> Any:
    """Return what a record's digest is taken of: a robot, say, is its description."""
    return getattr(record, "content", record)


def _cpu_seconds() -> float:
    """Return the CPU time of this process, seconds; workers give account of theirs."""
    times = os.times()
    return times.user + times.system


def _lock(path: Path) -> Any:
    """Take the folder for this process; the system lets go of it if the process dies."""
    file = path.open("w")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise RunError(
            f"{path.parent}: another besman is working here; wait or use --out"
        ) from None
    return file


def _stored(place: Path, key: str) -> dict[str, Any] | None:
    """Return the description of a stored result if it is whole and belongs to `key`."""
    try:
        description = json.loads((place / "stage.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if description.get("key") != key or not (place / "record.npz").is_file():
        return None
    return description if _checksum(place / "record.npz") == description.get("sha256") else None


def _checksum(path: Path) -> str:
    """Return the SHA-256 of a file, read piece by piece."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _store(place: Path, result: Any, description: dict[str, Any]) -> None:
    """Write a stage's folder under another name, then rename it."""
    temporary = place.with_name(f".{place.name}.tmp")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir()
    save_record(result, temporary / "record.npz")
    with (temporary / "record.npz").open("rb") as file:
        os.fsync(file.fileno())
    description = {**description, "sha256": _checksum(temporary / "record.npz")}
    write_json(temporary / "stage.json", description)
    old = place.with_name(f".{place.name}.old")
    shutil.rmtree(old, ignore_errors=True)
    if place.exists():
        place.rename(old)
    temporary.rename(place)
    shutil.rmtree(old, ignore_errors=True)
