"""Bags of ROS messages, without ROS: the library that reads them, their containers and topics.

The extra ``ros``. ``rosbags`` reads all three containers, MCAP and SQLite of ROS 2 and the bags of
ROS 1, in Python alone; what it raises of damaged files becomes one line here.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

from besman.exceptions import RecordingError, in_one_line, why_not_there

MCAP = b"\x89MCAP0\r\n"
ROS_1 = b"#ROSBAG V"
SQLITE = b"SQLite format 3\0"
_HEAD_BYTES = 32


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes
    ----------
    name : str
    kind : str
        Type of its messages, as ``sensor_msgs/msg/JointState``, of ROS 1 too.
    n_messages : int
    rate_hz : float
        Messages a second over the time of the bag; 0 of fewer than two.
    """

    name: str
    kind: str
    n_messages: int
    rate_hz: float

    def __str__(self) -> str:
        rate = f", {self.rate_hz:.3g} Hz" if self.rate_hz else ""
        return f"{self.name} ({self.kind}, {self.n_messages} messages{rate})"


class Definition(NamedTuple):
    """What a file says of a type of messages: ``ros2msg`` or ``ros2idl``, and the text."""

    encoding: str
    text: str


class RawMessage(NamedTuple):
    """A message as it stands in a bag of ROS 2.

    Attributes
    ----------
    topic, kind : str
        Its topic, and its type, as ``sensor_msgs/msg/JointState``.
    log_ns : int
        When it was logged, nanoseconds.
    data : bytes
    """

    topic: str
    kind: str
    log_ns: int
    data: bytes


class Bag:
    """An open bag; see `open_bag`."""

    def __init__(self, reader: Any, decode: Callable[[bytes, Any], Any]) -> None:
        self._reader, self._decode = reader, decode
        seconds = _seconds(reader)
        counts: dict[tuple[str, str], int] = {}
        for one in reader.connections:
            key = one.topic, one.msgtype
            counts[key] = counts.get(key, 0) + one.msgcount
        self.topics = tuple(
            Topic(name, kind, n, (n - 1) / seconds if n > 1 and seconds > 0 else 0.0)
            for (name, kind), n in sorted(counts.items())
        )

    def read(self, topics: Collection[Topic]) -> Iterator[tuple[str, int, Any]]:
        """Yield the messages of topics in the order of logging: topic, its time in ns, message."""
        wanted = {(topic.name, topic.kind) for topic in topics}
        chosen = [one for one in self._reader.connections if (one.topic, one.msgtype) in wanted]
        # Of the library none means all.
        for connection, stamp, data in self._reader.messages(chosen) if chosen else ():
            yield connection.topic, stamp, self._decode(data, connection)


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a bag; its content tells the container, whatever the file's ending.

    Parameters
    ----------
    path : Path
        An MCAP or SQLite file of ROS 2, or a bag of ROS 1.

    Yields
    ------
    Bag

    Raises
    ------
    RecordingError
        If the library is not installed, the file is not there, cut or damaged, or a message is not
        what its type says.
    """
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    _refuse_cut_database(path, head)
    make, is_ros_1 = _load_library(path, head)
    reader = None
    try:
        reader = make(path)
        reader.open()
        yield Bag(reader, _make_decoder(is_ros_1))
    except RecordingError:
        raise
    # Of a damaged file the library raises whatever comes of it.
    except Exception as error:
        raise RecordingError(
            f"{path}: cannot be read as a bag: {in_one_line(error):.200}; is the file cut or "
            "damaged? (ros2 bag reindex, or mcap recover, mends what was not closed)"
        ) from None
    finally:
        if reader is not None:
            _close(reader)


def _load_library(path: Path, head: bytes) -> tuple[Callable[[Path], Any], bool]:
    """Return what opens the container that a file begins like, and whether it is of ROS 1."""
    try:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
    except ImportError as error:
        reason = why_not_there(error, "rosbags", "besman[ros]")
        raise RecordingError(f"{path}: a bag of ROS messages: {reason}") from None
    if head.startswith(ROS_1):
        return Reader1, True
    ending = ".db3" if head.startswith(SQLITE) else ".mcap"
    return Reader2.STORAGE_PLUGINS[ending], False


def _refuse_cut_database(path: Path, head: bytes) -> None:
    """Refuse a database shorter than its header says: SQLite gives what is left of it."""
    if not head.startswith(SQLITE) or len(head) < _HEAD_BYTES:
        return
    log = path.with_name(path.name + "-wal")
    if log.exists() and log.stat().st_size:
        # The library does not look into it.
        raise RecordingError(
            f"{path}: {log.name} beside it holds what was written last: it is still being written, "
            f"or its writer was killed; then sqlite3 {path.name} 'PRAGMA wal_checkpoint(TRUNCATE)' "
            "makes it whole"
        )
    size = int.from_bytes(head[16:18], "big")
    expected = (65_536 if size == 1 else size) * int.from_bytes(head[28:32], "big")
    if path.stat().st_size < expected:
        raise RecordingError(
            f"{path}: {path.stat().st_size} bytes, and its header says {expected}; is the file cut?"
        )


def _make_decoder(is_ros_1: bool) -> Callable[[bytes, Any], Any]:
    """Return what makes a message of bytes and the library's connection that it came by."""
    if is_ros_1:
        store = _load_ros_1()
        return lambda data, connection: store.deserialize_ros1(data, connection.msgtype)
    decoders: dict[str, Callable[[bytes], Any]] = {}

    def decode(data: bytes, connection: Any) -> Any:
        kind, about = connection.msgtype, connection.msgdef
        if kind not in decoders:
            definition = Definition(f"ros2{about.format.name.lower()}", about.data)
            decoders[kind] = make_message_decoder(kind, definition)
        return decoders[kind](data)

    return decode


@cache
def _load_ros_1() -> Any:
    """Return the types of ROS 1, which the library compiles as they are first met."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS1_NOETIC)


# The library compiles what reads a type of messages: for files that define them alike only once.
@lru_cache(maxsize=32)
def make_message_decoder(kind: str, definition: Definition | None) -> Callable[[bytes], Any]:
    """Return what makes a message of the bytes of ROS 2, as the file that it stands in defines it.

    Parameters
    ----------
    kind : str
        Its type.
    definition : Definition, optional
        As in the file; where there is none, or one that cannot be read, the library's own.

    Raises
    ------
    RecordingError
        If nobody says what such a message is.
    """
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    try:
        if definition is not None and definition.text:
            is_idl = definition.encoding.endswith("idl")
            text = definition.text
            types = get_types_from_idl(text) if is_idl else get_types_from_msg(text, kind)
            store.register({name: one for name, one in types.items() if name not in store.types})
    # Of a definition that is none the library raises whatever comes of it.
    except Exception:
        store = get_typestore(Stores.EMPTY)
    if kind not in store.types:
        store = get_typestore(Stores.LATEST)
    if kind not in store.types:
        raise RecordingError(f"no definition of {kind:.100} in the file")
    return partial(store.deserialize_cdr, typename=kind)


def _seconds(reader: Any) -> float:
    """Return how long a bag goes on."""
    if hasattr(reader, "metadata"):
        return float(reader.metadata.end_time - reader.metadata.start_time) * 1e-9
    return float(reader.end_time - reader.start_time) * 1e-9


def _close(reader: Any) -> None:
    """Close a reader, also one whose file could not be opened."""
    import contextlib

    with contextlib.suppress(Exception):
        reader.close()
