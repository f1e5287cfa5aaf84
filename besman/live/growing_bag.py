"""The files of a ROS 2 bag while they are written, one after the other."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Protocol

from besman.exceptions import RecordingError
from besman.io.ros_messages import MCAP, SQLITE, Definition, RawMessage
from besman.live.growing_mcap import GrowingMcap
from besman.live.growing_sqlite import GrowingSqlite

_ENDINGS = (".mcap", ".db3")
# rosbag2 writes it when a bag is closed.
_CLOSED = "metadata.yaml"
# The next file of a bag that is split is there at once.
_NEXT_S = 2.0


class GrowingFile(Protocol):
    """One file; see `besman.live.growing_mcap.GrowingMcap`."""

    is_whole: bool
    is_ended_by_writer: bool
    definitions: dict[str, Definition]

    def read_new(self) -> list[RawMessage]:
        """Return what was written since."""

    def close(self) -> None:
        """Let the file go."""


class GrowingBag:
    """Messages of a bag in the order in which they are written.

    Parameters
    ----------
    path : Path
        A file, or the folder that rosbag2 writes; it may not be there yet.

    Attributes
    ----------
    ended : bool
        Whether the bag was closed and all was read.
    definitions : dict of str to Definition
        What its files say of the types of its messages.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.ended = False
        self.definitions: dict[str, Definition] = {}
        self._file: GrowingFile | None = None
        self._n_done, self._sign_s = 0, 0.0

    def find_files(self) -> list[Path]:
        """Return the files of the bag that are there, in their order.

        Raises
        ------
        RecordingError
            If it is something else.
        """
        try:
            if not self.path.is_dir():
                return [self.path] if self.path.stat().st_size >= len(SQLITE) else []
            files = [one for one in self.path.iterdir() if one.is_file()]
        except FileNotFoundError:
            return []
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be read: {error.strerror}") from None
        bags = [one for one in files if one.suffix in _ENDINGS]
        others = [one.name for one in files if one.suffix not in _ENDINGS]
        packed = [name for name in others if re.search(r"\.(mcap|db3)\.\w+$", name)]
        if packed and not bags:
            raise RecordingError(
                f"{self.path}: {packed[0]}: files that are compressed as a whole cannot be read "
                "while they are written; expected .mcap or .db3"
            )
        return sorted(bags, key=_order)

    def skip_files(self) -> None:
        """Begin with the last file that is there."""
        self._n_done = max(0, len(self.find_files()) - 1)

    @property
    def is_closed(self) -> bool:
        """Whether its writer says that it has ended."""
        if self._file is not None and self._file.is_whole and not self.path.is_dir():
            return True
        return self.path.is_dir() and (self.path / _CLOSED).is_file()

    def read_new(self) -> list[RawMessage]:
        """Return messages that were written since; none at the end, and where there are none yet.

        Raises
        ------
        RecordingError
            If a file is no bag, or damaged.
        """
        # Looked at before the messages: what is written until then is all of a bag that was closed.
        closed = self.is_closed
        if self._file is None:
            self._open_next()
        if self._file is None:
            self.ended |= closed
            return []
        found = self._file.read_new()
        self.definitions |= self._file.definitions
        if found:
            self._sign_s = 0.0
        elif self._is_done(closed):
            self._file.close()
            self._file, self._n_done, self._sign_s = None, self._n_done + 1, 0.0
            self.ended |= not self.path.is_dir()
        return found

    def close(self) -> None:
        """Let the files go."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _open_next(self) -> None:
        files = self.find_files()[self._n_done :]
        if not files:
            return
        path = files[0]
        try:
            with path.open("rb") as file:
                head = file.read(len(SQLITE))
            # The first thing that is written tells which it is.
            if not head or (head != SQLITE[: len(head)] and len(head) < len(MCAP)):
                return
            self._file = GrowingSqlite(path) if head.startswith(SQLITE[:8]) else GrowingMcap(path)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None

    def _is_done(self, closed: bool) -> bool:
        """Tell whether no message of the file will come any more; none came just now."""
        assert self._file is not None
        if not self.path.is_dir():
            return self._file.is_whole
        goes_on = closed or len(self.find_files()) > self._n_done + 1
        if goes_on and (self._file.is_whole or not self._file.is_ended_by_writer):
            return True
        if not goes_on and not self._file.is_whole:
            return False
        # One sign of two: rosbag2 begins the next file, and says that it has ended, before it ends
        # a file of MCAP. A writer that was killed does not end it.
        now = time.perf_counter()
        self._sign_s = self._sign_s or now
        done = now - self._sign_s > _NEXT_S
        self.ended |= done and not goes_on
        return done


def _order(path: Path) -> tuple[list[int], str]:
    """Return what sorts bag_2 before bag_10."""
    return [int(one) for one in re.findall(r"\d{1,18}", path.stem)], path.name
