"""A segments file that is saved often: whole at any time, never over what another wrote."""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from besman.exceptions import AnnotationError, ChangedError

NO_FILE = ""
"""Revision of a file that is not there."""


class Store:
    """One file, and the version before as ``FILE.bak``.

    ``.bak`` is what the file was when this session first wrote it, after an explicit save what it
    was at that save, and whatever was replaced although another program had written it.

    Parameters
    ----------
    path : Path
        The file; need not be there.

    Raises
    ------
    AnnotationError
        If the folder is missing, or folder or file must not be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path.resolve()
        self.backup = self.path.with_name(self.path.name + ".bak")
        self._keep = True
        folder = self.path.parent
        if not folder.is_dir():
            raise AnnotationError(f"{path}: cannot be written: no folder {folder}")
        if self.path.is_dir():
            raise AnnotationError(f"{path}: is a folder; expected a segments file")
        for place in (folder, *([self.path] if self.path.exists() else [])):
            if not os.access(place, os.W_OK):
                raise AnnotationError(
                    f"{path}: cannot be written: {place} is read-only; give a file elsewhere with "
                    "--segments"
                )

    def revision(self) -> str:
        """Return the digest of what stands in the file, `NO_FILE` if there is none."""
        try:
            return hashlib.sha256(self.path.read_bytes()).hexdigest()
        except FileNotFoundError:
            return NO_FILE
        except OSError as error:
            raise AnnotationError(f"{self.path}: cannot be read: {error.strerror}") from None

    def write(
        self, content: bytes, base: str, *, replace: bool = False, milestone: bool = False
    ) -> str:
        """Write the file: temporary name, fsync, rename. At any time the old or the new is there.

        Parameters
        ----------
        content : bytes
        base : str
            Revision that the content was made from.
        replace : bool
            Write even if the file is of another revision; that one is kept as ``.bak``.
        milestone : bool
            An explicit save: the next write keeps this version as ``.bak``.

        Returns
        -------
        str
            The revision of content; nothing is written where it stands in the file already.

        Raises
        ------
        ChangedError
            If the file is of another revision, and is not to be replaced.
        AnnotationError
            If it cannot be written.
        """
        digest = hashlib.sha256(content).hexdigest()
        try:
            with _locked(self.path.parent):
                now = self.revision()
                if now == digest:
                    self._keep = self._keep or milestone
                    return now
                if now != base and not replace:
                    raise ChangedError(
                        f"{self.path.name}: another window or program changed it in the meantime"
                    )
                if now != NO_FILE and (self._keep or now != base):
                    self._copy_to_backup()
                self._replace(content)
        except OSError as error:
            raise AnnotationError(f"{self.path}: cannot be written: {error.strerror}") from None
        self._keep = milestone
        return digest

    def _copy_to_backup(self) -> None:
        temporary = self.path.with_name(f".{self.backup.name}.tmp")
        shutil.copy2(self.path, temporary)
        temporary.replace(self.backup)

    def _replace(self, content: bytes) -> None:
        temporary = self.path.with_name(f".{self.path.name}.tmp")
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if self.path.exists():
            shutil.copymode(self.path, temporary)
        temporary.replace(self.path)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep other sessions from writing in the folder, and make what was renamed last."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
        os.fsync(handle)
    finally:
        os.close(handle)
