"""A SQLite bag while it is written, read without standing in its writer's way.

Who reads a database in a transaction keeps the writer of one without a write-ahead log from ending
its own, and rosbag2 gives up recording when that happens. So nothing is locked here: what was read
counts if no transaction of the writer ended meanwhile.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
import struct
import sys
import time
from pathlib import Path
from urllib.parse import quote

from besman.exceptions import RecordingError, in_one_line
from besman.io.ros_messages import SQLITE, Definition, RawMessage

_HEAD_BYTES = 100
# In the header of a database: 2 with a write-ahead log; how many transactions changed the file.
_VERSION, _CHANGES = 18, slice(24, 28)
# SQLite's own places in a file that its locks are of.
_LOCKS_AT, _LOCKS_BYTES = 0x40000000, 512
# The head of the index of a write-ahead log, and the byte in it that says that it is made.
_INDEX_BYTES, _MADE = 48, 12
# How a database is opened: with its log; without a lock; without anything beside it.
_LOGGED, _UNLOCKED, _AS_IT_IS = "mode=ro", "mode=ro&nolock=1", "mode=ro&immutable=1"
_ROWS = 2000
# For so long, and so often, what is read may not hold together, or be refused.
_TORN_S, _TORN_TIMES = 3.0, 20


class GrowingSqlite:
    """Reads rows that were added; see `besman.live.growing_mcap.GrowingMcap`.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    is_whole, is_ended_by_writer : bool
        False: a database does not say whether somebody writes it.
    definitions : dict of str to Definition
        Of files from ROS 2 Iron on.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.is_whole = self.is_ended_by_writer = False
        self.definitions: dict[str, Definition] = {}
        self._log = path.with_name(path.name + "-wal")
        self._last, self._torn_s, self._torn_times = 0, 0.0, 0
        self._state: tuple[int, ...] = ()
        self._file = path.open("rb")

    def read_new(self) -> list[RawMessage]:
        """Return messages that were added since, some thousand at once.

        Raises
        ------
        RecordingError
            If it is no bag, or damaged.
        """
        # Times of files go in steps in which much is written: the count of changes tells it apart.
        looked, head = self._look(), self._read_head()
        state = *looked, *head[_CHANGES]
        if state == self._state or len(head) < _HEAD_BYTES:
            return []
        if not head.startswith(SQLITE):
            raise RecordingError(f"{self.path}: is no SQLite database")
        how = self._find_way(head)
        if how is None:
            return []
        try:
            found = self._query(how)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            # The text of an error may hold what the file says, which need not be UTF-8.
            self._wait(in_one_line(error))
            return []
        if self._find_way(head) != how or (
            how != _LOGGED and self._read_head()[_CHANGES] != head[_CHANGES]
        ):
            self._wait("it never rests")
            return []
        self._torn_s, self._torn_times = 0.0, 0
        if found:
            self._last = found[-1][0]
        # Of more rows than are read at once the rest is there already.
        self._state = state if len(found) < _ROWS else ()
        return [RawMessage(*one[1:]) for one in found]

    def close(self) -> None:
        """Let the file go; see to it that its write-ahead log is not left over by this.

        Its writer brings what is in the log into the file when it ends, but not at a moment in
        which somebody reads. Who comes last then does: whoever opens the database to write.
        """
        self._file.close()
        if not self._log.exists():
            return
        # As long as the writer is there nothing is done by this; a folder may be for reading alone.
        with contextlib.suppress(sqlite3.Error):
            self._connect("mode=rw").close()

    def _look(self) -> tuple[int, ...]:
        """Return what differs after a write."""
        found: tuple[int, ...] = ()
        for path in (self.path, self._log):
            try:
                about = path.stat()
            except FileNotFoundError:
                continue
            except OSError as error:
                raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
            found += about.st_size, about.st_mtime_ns
        return found

    def _read_head(self) -> bytes:
        return os.pread(self._file.fileno(), _HEAD_BYTES, 0)

    def _is_written(self) -> bool:
        """Ask, without locking anything, whether another process writes pages of the file now."""
        if sys.platform != "linux":
            raise RecordingError(
                f"{self.path}: expected, but on Linux, a bag in MCAP, or one that is written with "
                "--storage-preset-profile resilient"
            )
        import fcntl

        # A lock to read is refused where somebody has one to write: of PENDING and SHARED alone.
        asked = struct.pack("hhqqi4x", fcntl.F_RDLCK, os.SEEK_SET, _LOCKS_AT, 1, 0)
        shared = struct.pack(
            "hhqqi4x", fcntl.F_RDLCK, os.SEEK_SET, _LOCKS_AT + 2, _LOCKS_BYTES - 2, 0
        )
        return any(
            struct.unpack("hhqqi4x", fcntl.fcntl(self._file, fcntl.F_GETLK, one))[0]
            != fcntl.F_UNLCK
            for one in (asked, shared)
        )

    def _find_way(self, head: bytes) -> str | None:
        """Return how the file can be read now so that nobody is locked out; None if it cannot."""
        if head[_VERSION] != 2:
            return None if self._is_written() else _UNLOCKED
        try:
            with self.path.with_name(self.path.name + "-shm").open("rb") as file:
                index = file.read(2 * _INDEX_BYTES)
        except FileNotFoundError:
            # Nobody has it, or somebody is about to: who comes first makes the index of the log,
            # and locks it meanwhile.
            return None if self._log.exists() else _AS_IT_IS
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be read: {error.strerror}") from None
        # It begins twice with the same, which says that it is made.
        one, other = index[:_INDEX_BYTES], index[_INDEX_BYTES:]
        return _LOGGED if one == other and len(one) > _MADE and one[_MADE] == 1 else None

    def _query(self, how: str) -> list[tuple[int, str, str, int, bytes]]:
        """Return new rows, by a connection that sees the file as it is now."""
        connection = self._connect(how)
        try:
            tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master")}
            if not {"topics", "messages"} <= tables:
                return []
            if "message_definitions" in tables:
                self.definitions |= {
                    kind: Definition(encoding, text)
                    for kind, encoding, text in connection.execute(
                        "SELECT topic_type, encoding, encoded_message_definition "
                        "FROM message_definitions"
                    )
                }
            return connection.execute(
                "SELECT messages.id, topics.name, topics.type, timestamp, data FROM messages "
                "JOIN topics ON topics.id = topic_id WHERE messages.id > ? "
                "ORDER BY messages.id LIMIT ?",
                (self._last, _ROWS),
            ).fetchall()
        finally:
            connection.close()

    def _connect(self, how: str) -> sqlite3.Connection:
        name = f"file:{quote(str(self.path))}?{how}"
        connection = sqlite3.connect(name, uri=True, timeout=0)
        try:
            # The file is opened by what is asked of it first.
            connection.execute("PRAGMA schema_version")
        except BaseException:
            connection.close()
            raise
        return connection

    def _wait(self, why: str) -> None:
        """Let what did not hold together be read again, but not for ever."""
        now = time.perf_counter()
        self._torn_s, self._torn_times = self._torn_s or now, self._torn_times + 1
        if now - self._torn_s > _TORN_S and self._torn_times > _TORN_TIMES:
            raise RecordingError(f"{self.path}: cannot be read while it is written: {why:.120}")
