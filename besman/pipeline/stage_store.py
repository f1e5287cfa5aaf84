"""Results of stages on the disk, each in a folder of its own: whole, or not there."""

from __future__ import annotations

import hashlib
import math
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from besman.exceptions import RunError
from besman.foreign.json_text import parse_json
from besman.io.atomic_files import folder_aside, make_folder, write_json
from besman.records import Failure
from besman.records.files import load_record, save_record

RECORD = "record.npz"
DESCRIPTION = "stage.json"
_SPENT = "spent.json"


@dataclass(frozen=True)
class StageDescription:
    """What ``stage.json`` says.

    Attributes
    ----------
    key : str
        Digest of all that the result depends on.
    method : str
        Of the stage.
    config : dict
        Its settings.
    versions : dict of str
        Of the libraries that computed the result.
    wall_s : float
        What that took, seconds.
    failed : tuple of Failure
        What it left out.
    sha256 : str
        Of the record.
    """

    key: str
    method: str
    config: dict[str, Any]
    versions: dict[str, str]
    wall_s: float
    failed: tuple[Failure, ...]
    sha256: str = ""


class DamageError(Exception):
    """A stored stage that cannot be used; the text says why."""


def read_description(place: Path) -> StageDescription:
    """Read ``stage.json`` of a stage's folder.

    Raises
    ------
    DamageError
        If it is missing, or not as besman writes it.
    """
    return _parse(_read(place))


def load_stage(place: Path, key: str) -> tuple[Any, StageDescription] | None:
    """Load a stored result, if it belongs to a key.

    Returns
    -------
    record, description
        Or None if there is none, or one of another key.

    Raises
    ------
    DamageError
        If there is one that cannot be used.
    """
    if not place.exists():
        return None
    content = _read(place)
    # What another version of besman wrote has another key, and may have other fields.
    if isinstance(content.get("key"), str) and content["key"] != key:
        return None
    description = _parse(content)
    check_record(place, description)
    try:
        return load_record(place / RECORD), description
    except (RunError, TypeError) as error:
        raise DamageError(str(error)) from None


def _read(place: Path) -> dict[str, Any]:
    try:
        content = parse_json((place / DESCRIPTION).read_bytes())
    except OSError as error:
        raise DamageError(f"{DESCRIPTION}: {error.strerror}") from None
    except ValueError:
        raise DamageError(f"{DESCRIPTION} is no JSON") from None
    if not isinstance(content, dict):
        raise DamageError(f"{DESCRIPTION} is a {type(content).__name__}, expected an object")
    return content


def _parse(content: dict[str, Any]) -> StageDescription:
    """Check every field: what is read is as it was written, or damaged."""
    kinds = {field.name: field.type for field in fields(StageDescription)}
    for name in sorted(kinds.keys() ^ content.keys(), key=str):
        raise DamageError(
            f"{DESCRIPTION}: {name!r:.40} is {'missing' if name in kinds else 'unknown'}"
        )
    seconds = content["wall_s"]
    whole = (
        _are_texts([content[name] for name in ("key", "method", "sha256")])
        and isinstance(content["config"], dict)
        and isinstance(content["versions"], dict)
        and _are_texts(content["versions"].values())
        and isinstance(seconds, int | float)
        and math.isfinite(seconds)
        and seconds >= 0
        and isinstance(content["failed"], list)
        and all(_is_failure(one) for one in content["failed"])
    )
    if not whole:
        raise DamageError(f"{DESCRIPTION} is not as it was written")
    failed = tuple(Failure(**one) for one in content["failed"])
    return StageDescription(**{**content, "failed": failed})


def _are_texts(values: Iterable[Any]) -> bool:
    return all(isinstance(value, str) for value in values)


def _is_failure(content: Any) -> bool:
    return (
        isinstance(content, dict)
        and content.keys() == {"name", "reason"}
        and _are_texts(content.values())
    )


def check_record(place: Path, description: StageDescription) -> None:
    """See that the record is the one that was described.

    Raises
    ------
    DamageError
    """
    try:
        found = checksum(place / RECORD)
    except OSError as error:
        raise DamageError(f"{RECORD}: {error.strerror}") from None
    if found != description.sha256:
        raise DamageError(f"{RECORD} is cut or changed")


def store_stage(place: Path, result: Any, description: StageDescription) -> None:
    """Write a stage's folder, whole or not at all.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    with folder_aside(place) as temporary:
        save_record(result, temporary / RECORD)
        with (temporary / RECORD).open("rb") as file:
            os.fsync(file.fileno())
        content = asdict(description) | {"sha256": checksum(temporary / RECORD)}
        write_json(temporary / DESCRIPTION, content)


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file, read piece by piece."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def spent_before(going: Path, now: float) -> float:
    """Return the seconds that led to the checkpoints in a folder, and begin to count anew.

    Of a computation that was ended, even by force, what counts is the time until it kept something
    last: the rest is done once more.

    Parameters
    ----------
    going : Path
        Of the checkpoints.
    now : float
        Seconds of the system's clock, which the files' times are of.

    Returns
    -------
    float
    """
    note, spent = going / _SPENT, 0.0
    try:
        before = parse_json(note.read_bytes())
        kept = [one.stat().st_mtime for one in going.rglob("*") if one.is_file() and one != note]
        until = max(kept, default=float(before["since"]))
        spent = float(before["spent_s"]) + max(until - float(before["since"]), 0.0)
    except (OSError, ValueError, TypeError, KeyError):
        spent = 0.0  # The first time, or cut: nothing is known of before.
    spent = spent if math.isfinite(spent) else 0.0
    write_json(note, {"spent_s": spent, "since": now})
    return spent


@contextmanager
def checkpoint_folder(place: Path, key: str, *, fresh: bool) -> Iterator[Path]:
    """Give a folder for what a stage keeps on its way; it goes when the stage has ended well.

    Parameters
    ----------
    place : Path
        The stage's folder.
    key : str
        Checkpoints of another key go.
    fresh : bool
        Whether those of this key go, too.
    """
    going = place.with_name(f".{place.name}.going")
    own = going / key[:16]
    for other in going.glob("*"):
        if other != own or fresh:
            shutil.rmtree(other, ignore_errors=True)
    make_folder(own)
    yield own
    shutil.rmtree(going, ignore_errors=True)
