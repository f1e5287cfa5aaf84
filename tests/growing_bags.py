"""Bags that are written while they are read: by the MCAP library, and as rosbag2 uses SQLite."""

import os
import sqlite3
import struct
import sys
import time
from itertools import count
from pathlib import Path

MOCAP = "mocap4r2_msgs/msg/Markers"
MOCAP_DEFINITION = """\
std_msgs/Header header
uint32 frame_number
mocap4r2_msgs/Marker[] markers
================================================================================
MSG: mocap4r2_msgs/Marker
int8 USE_NAME=0
int8 USE_INDEX=1
int8 id_type
int32 marker_index
string marker_name
geometry_msgs/Point translation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


class McapWriter:
    """Writes messages, each at once or in chunks."""

    def __init__(self, path, chunk_bytes=None, compression="ZSTD"):
        from mcap.writer import CompressionType, Writer

        self._file = path.open("wb")
        self._writer = Writer(
            self._file, chunk_bytes or 1, CompressionType[compression],
            use_chunking=chunk_bytes is not None,
        )  # fmt: skip
        self._writer.start("ros2")
        self._channels = {}

    def write(self, topic, kind, definition, log_ns, data):
        if topic not in self._channels:
            schema = self._writer.register_schema(kind, "ros2msg", definition.encode())
            self._channels[topic] = self._writer.register_channel(topic, "cdr", schema)
        self._writer.add_message(self._channels[topic], log_ns, data, log_ns)
        self._file.flush()

    def finish(self):
        self._writer.finish()
        self._file.close()

    def abandon(self):
        """As a writer that was killed leaves it."""
        self._file.close()


class SqliteWriter:
    """Writes as rosbag2 does: a transaction for what has come, and never waits for a lock."""

    def __init__(self, path, journal):
        self._database = sqlite3.connect(path, isolation_level=None, timeout=0)
        for statement in (
            f"PRAGMA journal_mode={journal}",
            f"PRAGMA synchronous={'OFF' if journal == 'MEMORY' else 'NORMAL'}",
            "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL)",
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
            "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL, "
            "type_description_hash TEXT NOT NULL)",
            "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, "
            "encoding TEXT NOT NULL, encoded_message_definition TEXT NOT NULL, "
            "type_description_hash TEXT NOT NULL)",
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
            "timestamp INTEGER NOT NULL, data BLOB NOT NULL)",
            "CREATE INDEX timestamp_idx ON messages (timestamp ASC)",
            "INSERT INTO schema VALUES (4, 'jazzy')",
        ):
            self._database.execute(statement)
        self._topics = {}

    def write_all(self, rows):
        """Write rows of topic, kind, definition, log time and data in one transaction."""
        self._database.execute("BEGIN TRANSACTION")
        for topic, kind, definition, log_ns, data in rows:
            if topic not in self._topics:
                self._topics[topic] = len(self._topics) + 1
                self._database.execute(
                    "INSERT INTO topics VALUES (?, ?, ?, 'cdr', '', '')",
                    (self._topics[topic], topic, kind),
                )
                self._database.execute(
                    "INSERT INTO message_definitions (topic_type, encoding, "
                    "encoded_message_definition, type_description_hash) VALUES (?, ?, ?, '')",
                    (kind, "ros2msg", definition),
                )
            self._database.execute(
                "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)",
                (self._topics[topic], log_ns, data),
            )
        self._database.execute("COMMIT")

    def close(self):
        self._database.close()


def point_message(stamp_ns, x):
    """Return a ``geometry_msgs/PointStamped`` in a frame of reference whose name is long."""
    frame = b"world" * 1200 + b"\0"
    head = b"\0\1\0\0" + struct.pack("<iII", *divmod(stamp_ns, 10**9), len(frame)) + frame
    pad = b"\0" * (-(len(head) - 4) % 8)
    return head + pad + struct.pack("<3d", x, 0.5 * x, 1.0)


def write_points(path, journal, enough):
    """Write points, a transaction each, as fast as it goes, until a file says that it is enough.

    For a process of its own, which ends with the one that started it; prints how many.
    """
    writer, parent = SqliteWriter(path, journal), os.getppid()
    for row in count(1):
        at = 10**9 + row * 10**7
        data = point_message(at, float(row))
        writer.write_all([("/hand", "geometry_msgs/msg/PointStamped", "", at, data)])
        if row % 50 == 0:
            if enough.exists() or os.getppid() != parent:
                break
            time.sleep(0.01)
    writer.close()
    print(row)


if __name__ == "__main__":
    write_points(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
