"""An MCAP file while it is written: each record once it is there whole."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from besman.exceptions import RecordingError, in_one_line
from besman.io.ros_messages import MCAP, Definition, RawMessage

_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 3, 4, 5, 6, 15
_HEAD_BYTES = 9
# Of one record, and of what a chunk becomes: ROS writes chunks below a megabyte.
_LARGEST = 1 << 28
_AT_ONCE = 1 << 22


class GrowingMcap:
    """Reads what has been appended; a chunk can be read when its last byte is there.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    is_whole : bool
        Whether its writer has closed it: no message comes any more.
    is_ended_by_writer : bool
        Whether writers mark the end.
    definitions : dict of str to Definition
        What the file says of the types of its messages.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.is_whole, self.is_ended_by_writer = False, True
        self.definitions: dict[str, Definition] = {}
        self._file = path.open("rb")
        self._rest = b""
        self._begun = False
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, tuple[str, str]] = {}

    def read_new(self) -> list[RawMessage]:
        """Return messages that were written since; few megabytes at once.

        Raises
        ------
        RecordingError
            If it is no MCAP file, or damaged.
        """
        data = self._rest + self._file.read(_AT_ONCE)
        try:
            found, at = self._read_records(data, self._skip_magic(data))
        except RecordingError:
            raise
        # Of damaged records the library raises whatever comes of it.
        except Exception as error:
            raise RecordingError(
                f"{self.path}: cannot be read as MCAP: {in_one_line(error):.200}"
            ) from None
        self._rest = data[at:]
        return found

    def close(self) -> None:
        """Let the file go."""
        self._file.close()

    def _skip_magic(self, data: bytes) -> int:
        """Return where the first record begins."""
        if self._begun:
            return 0
        if not data.startswith(MCAP[: len(data)]):
            raise RecordingError(f"{self.path}: is no MCAP file")
        self._begun = len(data) >= len(MCAP)
        return len(MCAP) if self._begun else 0

    def _read_records(self, data: bytes, at: int) -> tuple[list[RawMessage], int]:
        """Read the whole records of what is there; return where the first cut one begins."""
        found: list[RawMessage] = []
        while self._begun and not self.is_whole and len(data) - at >= _HEAD_BYTES:
            length = int.from_bytes(data[at + 1 : at + _HEAD_BYTES], "little")
            if length > _LARGEST:
                raise RecordingError(
                    f"{self.path}: a record of {length} bytes; expected at most {_LARGEST}"
                )
            end = at + _HEAD_BYTES + length
            if end > len(data):
                break
            self._take(data[at], data[at + _HEAD_BYTES : end], found)
            at = end
        return found, at

    def _take(self, kind: int, body: bytes, found: list[RawMessage]) -> None:
        """Take a record by its number in the format."""
        from mcap.data_stream import ReadDataStream
        from mcap.records import Channel, Chunk, Message, Schema
        from mcap.stream_reader import breakup_chunk

        stream = ReadDataStream(io.BytesIO(body))
        if kind == _CHUNK:
            chunk = Chunk.read(stream)
            self._refuse_large(chunk)
            for one in breakup_chunk(chunk):
                self._note(one, found)
        elif kind == _SCHEMA:
            self._note(Schema.read(stream), found)
        elif kind == _CHANNEL:
            self._note(Channel.read(stream), found)
        elif kind == _MESSAGE:
            self._note(Message.read(stream, len(body)), found)
        self.is_whole |= kind == _DATA_END

    def _note(self, one: Any, found: list[RawMessage]) -> None:
        """Note a type, a topic or a message, as the library gives it."""
        from mcap.records import Channel, Schema

        if isinstance(one, Schema):
            self._schemas[one.id] = one.name
            text = one.data.decode("utf-8", "replace")
            self.definitions[one.name] = Definition(one.encoding, text)
        elif isinstance(one, Channel):
            if one.message_encoding in ("cdr", ""):
                self._channels[one.id] = one.topic, self._schemas.get(one.schema_id, "")
        elif one.channel_id in self._channels:
            found.append(RawMessage(*self._channels[one.channel_id], one.log_time, one.data))

    def _refuse_large(self, chunk: Any) -> None:
        """Refuse a chunk that says, or whose bytes say, that it becomes very large."""
        import zstandard

        sizes = [chunk.uncompressed_size]
        if chunk.compression == "zstd":
            sizes.append(zstandard.frame_content_size(chunk.data))
        if max(sizes) > _LARGEST:
            raise RecordingError(
                f"{self.path}: a chunk that becomes {max(sizes)} bytes; expected at most {_LARGEST}"
            )
