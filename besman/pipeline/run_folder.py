"""The run folder: cached stages, exports, timing. A crash leaves no half of anything."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from besman.config.stage import Step, Truth
from besman.exceptions import RunError
from besman.io.atomic_files import make_folder
from besman.pipeline.clock import Clock
from besman.pipeline.run_lock import take_lock
from besman.pipeline.run_record import RunRecord
from besman.pipeline.stage_store import (
    DamageError,
    StageDescription,
    checkpoint_folder,
    load_stage,
    spent_before,
    store_stage,
)
from besman.records import Failure
from besman.records.files import digest
from besman.robot.model import Robot
from besman.stages.export.motion_exports import write_exports
from besman.stages.export.withheld import withheld_motions
from besman.work.display import Display
from besman.work.outcome import Notes
from besman.work.versions import code_version, result_versions
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
    folder : Path
    truth : Truth
        What the figures of the stages are held against.

    Raises
    ------
    RunError, FileError
        If the folder holds something else, cannot be written, or another process is using it.
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
        make_folder(folder, kind=RunError)
        self.folder = folder
        self.jobs = jobs
        self.fresh = fresh
        self.truth = Truth()
        self._failed: dict[str, list[Failure]] = {}
        self._workers = workers
        self._display = display
        self._code = code_version()
        self._lock = take_lock(folder)
        self._record = RunRecord(folder, name, self._code)

    @property
    def results(self) -> dict[str, Any]:
        """Figures of the stages, for ``results.json``."""
        return self._record.results

    @property
    def timing(self) -> list[dict[str, Any]]:
        """Rows of ``timing.json``."""
        return self._record.timing

    def start(self, pipeline_yaml: str, inputs: dict[str, str]) -> None:
        """Write what is known before the first stage; see `RunRecord.begin`."""
        self._record.begin(pipeline_yaml, inputs)

    def know(self, truth: Truth) -> None:
        """Take what figures are held against."""
        self.truth = truth
        self._record.keep_truth(truth.blocks)

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
        assert not named
        result, row, place = self._do(name, stage, *records)
        figures = stage.figures(result, self.truth, *records)
        left_out = {}
        if stage.config.leaves_out:
            left_out = {"failed": [asdict(one) for one in self._failed[name]]}
        sections = figures if isinstance(figures, tuple) else (figures,)
        for section, arm in zip(sections, ("", "_second"), strict=False):
            if section:
                self.results[f"{name}{arm}"] = section | left_out
        self._record.add_stage(row, place, len(self._failed[name]))
        return result

    def prepare(
        self,
        name: str,
        stage: Step[Records, Result],
        /,
        *records: Records.args,
        **named: Records.kwargs,
    ) -> Result:
        """Run a stage, or load its result if all that it depends on is the same as before.

        That is its config, besman's code, the libraries, and its input.

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
        result, row, place = self._do(name, stage, *records)
        self._record.add_stage(row, place, len(self._failed[name]))
        return result

    def _do(
        self, name: str, stage: Step[..., Result], *records: Any
    ) -> tuple[Result, dict[str, Any], Path]:
        """Run a stage, or load its result; return it, its row of the timing, and its folder."""
        config, items = stage.config, stage.items(*records)
        place = self.folder / f"{len(self.timing):02d}_{name}"
        versions = result_versions(config.libraries)
        content = tuple(_content(record) for record in records)
        key = digest((config, type(stage).__name__, self._code, versions, content))
        clock, notes = Clock(), Notes()
        found = None if name == self.fresh else self._load(place, key)
        if found is not None:
            result: Result = found[0]
            description = found[1]
            notes.failures = list(description.failed)
        else:
            if self._workers is not None:
                self._workers.start()
            kept = checkpoint_folder(place, key, fresh=name == self.fresh)
            with kept if config.keeps_checkpoints else nullcontext() as checkpoints:
                before = spent_before(checkpoints, time.time()) if checkpoints else 0.0
                result = self.work(name, stage.run, *records, notes=notes, checkpoints=checkpoints)
                description = StageDescription(
                    key=key,
                    method=getattr(config, "method", ""),
                    config=config.model_dump(mode="json"),
                    versions=versions,
                    wall_s=before + clock.wall_s,
                    failed=tuple(notes.failures),
                )
                store_stage(place, result, description)
        self._failed[name] = notes.failures
        row = clock.row(name, items, notes, computed=description.wall_s, cached=found is not None)
        return result, row, place

    def _load(self, place: Path, key: str) -> tuple[Any, StageDescription] | None:
        """Load a stored result, if it belongs to a key; what is damaged is said and left."""
        try:
            return load_stage(place, key)
        except DamageError as damage:
            self._record.log(f"{place.name}: {damage}: computed again")
            return None

    def note(self, line: str) -> None:
        """Add a line to the run's log."""
        self._record.log(line)

    def export(
        self,
        name: str,
        motions: tuple[Any, ...],
        robot: Robot,
        write: Callable[..., None] = write_exports,
    ) -> None:
        """Write motions as files for the arm, if those that are there are not theirs, or damaged.

        The results say which are withheld, because they are beyond a limit.

        Parameters
        ----------
        name : str
            Of the folder.
        motions : tuple of RefinedMotion
            Or of what `write` takes.
        robot : Robot
        write : callable
            Takes motions, robot, folder and work.
        """
        folder = self.folder / name
        of = digest((motions, robot.content, self._code, result_versions()))
        fault = self._record.fault_of_exports(folder, of)
        if fault:
            self._record.log(f"{fault}: written again")
        if fault is not None:
            self.work(name, write, motions, robot, folder)
            self._record.add_exports(folder, of)
        withheld = withheld_motions(folder)
        self.results[name] = {"n_motions": len(motions), "withheld": withheld}
        for motion, why in withheld.items():
            self._record.log(f"{name}: {motion} is not exported: {why}")

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

    def record_time(self, row: dict[str, Any]) -> None:
        """Add a row to the timing table, of what is no stage; see `Clock.row`."""
        self._record.add_timing(row)

    def finish(self, status: str = "done", error: str | None = None) -> None:
        """Write results, timing and status, and let go of the folder."""
        try:
            self._record.end(status, error)
        finally:
            self._lock.close()


def _content(record: Any) -> Any:
    """Return what a record's digest is taken of: a robot, say, is its description."""
    return getattr(record, "content", record)
