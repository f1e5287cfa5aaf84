"""A run as it lies on the disk: what it says of itself, and which stages are its own."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from besman.exceptions import RunError
from besman.foreign.json_text import parse_json
from besman.pipeline.run_lock import is_locked
from besman.pipeline.stage_store import DESCRIPTION, RECORD, checksum
from besman.records.files import digest, load_record

# Bytes, on every file system in use.
_LONGEST_NAME = 255
_STAGE = re.compile(r"\d{2,}_\w+")
_STATUS = ("running", "done", "failed")

FILES = ("pipeline.yaml", "truth.npz", "results.json", "timing.json")
"""What a run writes beside its stages."""


@dataclass(frozen=True)
class StoredRun:
    """A run folder, read.

    Attributes
    ----------
    folder : Path
    state : dict
        Content of ``run.json``.
    stages : dict of Path
        Folders of the stages that this run has done, by their names, in their order. Others may
        lie beside them: of a recipe that was run here before.
    """

    folder: Path
    state: dict[str, Any]
    stages: dict[str, Path]

    @property
    def status(self) -> str:
        """``done``, ``failed``, ``running``, or ``killed``: it says running, and nobody runs it."""
        status = str(self.state.get("status"))
        if status == "running" and not is_locked(self.folder):
            return "killed"
        return status

    def record(self, stage: str) -> Any:
        """Load the result of a stage.

        Raises
        ------
        RunError
            If this run has not done the stage, or the file is damaged.
        """
        if stage not in self.stages:
            raise RunError(f"{self.folder}: stage {stage} is not done; finish the run first")
        return load_record(self.stages[stage] / RECORD)

    def read(self, name: str) -> dict[str, Any]:
        """Read ``results.json`` or ``timing.json``.

        Raises
        ------
        RunError
            If it is missing, damaged, or no object.
        """
        return read_object(self.folder / name)

    def fingerprint(self) -> str:
        """Return a digest of all that a report shows of the run."""
        shown = {name: self.checksum(name) for name in self.stages}
        return digest((shown, _checksum(self.folder / "results.json"), self.status))

    def checksum(self, stage: str) -> str | None:
        """Return the SHA-256 of a stage's record; None where there is none."""
        place = self.stages.get(stage)
        return None if place is None else _checksum(place / RECORD)

    def changed(self) -> list[str]:
        """Return the files of an ended run that are not as it has written them.

        Of a run that was written before ``run.json`` had their digests nobody knows.
        """
        written = self.state.get("files", {})
        return [name for name in FILES if _checksum(self.folder / name) != written.get(name)]

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Let what cannot be read be the fault of a file that was changed, if there is one.

        Raises
        ------
        RunError
            In place of an error about content that is not as expected.
        """
        try:
            yield
        except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
            changed = self.changed()
            if not changed:
                raise
            raise RunError(
                f"{self.folder}: {' or '.join(changed)} cannot be used, and is not what the run "
                f"has written ({type(error).__name__}: {error}); besman run writes it anew"
            ) from None


def open_run(folder: Path, *, needs_state: bool = True) -> StoredRun:
    """Read what a run says of itself.

    A run that was written before ``run.json`` listed the stages has those with the highest
    numbers.

    Parameters
    ----------
    folder : Path
    needs_state : bool
        Whether ``run.json`` must be there; stages may be read without.

    Raises
    ------
    RunError
        If the folder is not a run, or its ``run.json`` is damaged.
    """
    path = folder / "run.json"
    state = read_object(path) if needs_state or path.exists() else {}
    if needs_state and not (folder / "pipeline.yaml").is_file():
        raise RunError(f"{folder}: not a run: pipeline.yaml is missing")
    if state and not _is_whole(state):
        raise RunError(f"{path}: is not as besman writes it; besman run writes it anew")
    names = state.get("stages")
    if names is None:
        names = sorted(place.name for place in folder.glob("*") if is_stage_folder(place))
    # The later one of two with one name.
    return StoredRun(folder, state, {name.partition("_")[2]: folder / name for name in names})


def is_stage_folder(place: Path) -> bool:
    """Tell whether a folder holds the result of a stage."""
    is_named = _STAGE.fullmatch(place.name) is not None
    return is_named and any((place / name).exists() for name in (RECORD, DESCRIPTION))


def read_object(path: Path) -> dict[str, Any]:
    """Read a JSON file of a run.

    Raises
    ------
    RunError
        If it is missing, damaged, or no object.
    """
    try:
        content = parse_json(path.read_bytes())
    except FileNotFoundError:
        raise RunError(f"{path.parent}: not a run: {path.name} is missing") from None
    except OSError as error:
        raise RunError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise RunError(f"{path}: cannot be read: {error}") from None
    if not isinstance(content, dict):
        raise RunError(f"{path}: expected an object, got a {type(content).__name__}")
    return content


def _checksum(path: Path) -> str | None:
    return checksum(path) if path.is_file() else None


def _is_whole(state: dict[str, Any]) -> bool:
    """Tell whether what a run says of itself can be used."""
    # Older runs have not all of these.
    parts = {"stages": _are_stages, "files": _are_digests, "exports": _are_exports}
    return (
        isinstance(state.get("name"), str)
        and state.get("status") in _STATUS
        and isinstance(state.get("error"), str | None)
        and all(isinstance(state.get(name), dict) for name in ("versions", "machine", "inputs"))
        and isinstance(state.get("commit"), str)
        and all(are_whole(state[name]) for name, are_whole in parts.items() if name in state)
    )


def _are_stages(names: Any) -> bool:
    return isinstance(names, list) and all(
        isinstance(name, str) and _STAGE.fullmatch(name) is not None for name in names
    )


def _is_file_name(name: str) -> bool:
    """Tell whether a name can be one of a file in a folder."""
    return name.isprintable() and "/" not in name and 0 < len(name.encode()) <= _LONGEST_NAME


def _are_digests(files: Any) -> bool:
    return isinstance(files, dict) and all(
        isinstance(digest, str) and _is_file_name(name) for name, digest in files.items()
    )


def _are_exports(exports: Any) -> bool:
    return isinstance(exports, dict) and all(
        isinstance(one, dict)
        and one.keys() == {"of", "files"}
        and isinstance(one["of"], str)
        and _are_digests(one["files"])
        and _is_file_name(name)
        for name, one in exports.items()
    )
