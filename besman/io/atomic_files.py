"""Files that a reader sees whole or not at all; whatever stops a write is one line that says where.

Every file that besman writes is written by these functions, or to the path that `written_aside`
gives.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from besman.exceptions import BesmanError, FileError
from besman.records.files import save_record


@contextmanager
def written_aside(
    path: Path, *, durable: bool = False, kind: type[BesmanError] = FileError
) -> Iterator[Path]:
    """Give a path to write to; what stands there in the end becomes `path`, whole or not at all.

    Parameters
    ----------
    path : Path
        The file; what it was is replaced.
    durable : bool
        Whether it must be on the disk before it gets its name, also if the power fails.
    kind : type
        Of the error that says what stopped it.

    Yields
    ------
    Path
        In the same folder, with the same ending.

    Raises
    ------
    BesmanError
        Of that kind, if it cannot be written: a full disk, no permission, no such folder.
    """
    # Two threads of one process may write one file.
    own = f"{os.getpid()}_{threading.get_ident()}"
    temporary = path.with_name(f".{path.stem}.tmp{own}{path.suffix}")
    try:
        with says_where(path, kind):
            yield temporary
            if durable:
                with temporary.open("rb") as file:
                    os.fsync(file.fileno())
            temporary.replace(path)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def says_where(path: Path, kind: type[BesmanError] = FileError) -> Iterator[None]:
    """Turn what the system says of a write into one line that names the path.

    Raises
    ------
    BesmanError
        Of that kind.
    """
    try:
        yield
    except OSError as error:
        raise kind(f"{path}: cannot be written: {error.strerror or error}") from None


def write_json(path: Path, content: Any, *, durable: bool = True) -> None:
    """Write JSON; numbers of any library become JSON's, what is not a number becomes null.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    text = json.dumps(_plain(content), indent=2, allow_nan=False) + "\n"
    write_text(path, text, durable=durable)


def _plain(content: Any) -> Any:
    """Turn numbers of any library into JSON's; what is not a number becomes null."""
    if isinstance(content, dict):
        return {str(key): _plain(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_plain(value) for value in content]
    if hasattr(content, "tolist"):
        return _plain(content.tolist())
    if isinstance(content, float) and not math.isfinite(content):
        return None
    return content


def write_text(
    path: Path, text: str, *, durable: bool = True, kind: type[BesmanError] = FileError
) -> None:
    """Write a text file in UTF-8, its lines as they are; see `written_aside`.

    Raises
    ------
    BesmanError
        Of that kind, if it cannot be written.
    """
    with written_aside(path, durable=durable, kind=kind) as temporary:
        temporary.write_bytes(text.encode())


def write_record(path: Path, record: Any, *, durable: bool = True) -> None:
    """Write a record as ``.npz``; see `besman.records.files.save_record`.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    with written_aside(path, durable=durable) as temporary:
        save_record(record, temporary)


def make_folder(path: Path, kind: type[BesmanError] = FileError) -> None:
    """Make a folder and those above it, where they are not there.

    Raises
    ------
    BesmanError
        Of that kind, if it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise kind(f"{path}: cannot be written: is a file, expected a folder") from None
    except OSError as error:
        raise kind(f"{path}: cannot be written: {error.strerror or error}") from None


@contextmanager
def folder_aside(folder: Path, keep: Callable[[str], bool] = lambda name: False) -> Iterator[Path]:
    """Give an empty folder to write to; in the end it takes the place of `folder`, as a whole.

    Parameters
    ----------
    folder : Path
        What is in it goes; the folder above is there.
    keep : callable
        Tells by its name what in it stays.

    Yields
    ------
    Path
        A folder beside it.

    Raises
    ------
    FileError
        If something cannot be written.
    """
    temporary, old = (folder.with_name(f".{folder.name}.{end}") for end in ("tmp", "old"))
    try:
        with says_where(folder):
            if old.exists() and not folder.exists():
                # Whoever was ended in the middle of what follows.
                old.rename(folder)
            for left in (temporary, old):
                remove_folder(left)
            temporary.mkdir()
            yield temporary
            if folder.exists():
                for own in folder.iterdir():
                    if keep(own.name):
                        own.rename(temporary / own.name)
                folder.rename(old)
            temporary.rename(folder)
            remove_folder(old)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def remove_folder(folder: Path) -> None:
    """Remove a folder with all that is in it, if it is there.

    Raises
    ------
    FileError
        If it cannot be removed.
    """
    with says_where(folder), suppress(FileNotFoundError):
        shutil.rmtree(folder)


def check_file(path: Path, where: str = "", kind: type[BesmanError] = FileError) -> None:
    """See before the work that a file can be written after it; an existing one is replaced.

    Parameters
    ----------
    path : Path
    where : str
        How the message begins, if not with the path.
    kind : type
        Of the error.

    Raises
    ------
    BesmanError
        Of that kind, if it is a folder, its folder is not there, or one of them may not be written.
    """
    where = where or f"{path}"
    if path.is_dir():
        raise kind(f"{where}: is a folder; expected the name of a file")
    if not path.parent.is_dir():
        raise kind(f"{where}: there is no folder {path.parent}")
    for place in (path.parent, path):
        if place.exists() and not os.access(place, os.W_OK):
            raise kind(f"{where}: cannot be written: {place} is read-only")


def check_folder(path: Path, where: str = "", kind: type[BesmanError] = FileError) -> None:
    """See before the work that files can be written to a folder after it; it may be made then.

    Parameters
    ----------
    path, where, kind
        As of `check_file`.

    Raises
    ------
    BesmanError
        Of that kind, if it is a file, below one, or may not be written.
    """
    where = where or f"{path}"
    there = next(place for place in (path, *path.absolute().parents) if place.exists())
    if not there.is_dir():
        raise kind(f"{where}: cannot be written: {there} is a file, expected a folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise kind(f"{where}: cannot be written: {there} is read-only")
