#!/usr/bin/env bash
# rosbags 0.11.6: of a SQLite bag whose recorder was killed, or still runs, with a write-ahead log (rosbag2's storage preset
# "resilient"), it returns the messages of the file without those of the log, and says nothing.
#
# It opens databases as immutable, where SQLite does not look for NAME.db3-wal. SQLite itself, and with it ROS, reads them all.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" rosbags==0.11.6 \
    >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
cd "$place"
PYTHONPATH=$place/packages python3 - <<'PY'
import os
import sqlite3
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
text = store.types["std_msgs/msg/String"]
with Writer(Path("bag"), version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
    topic = writer.add_connection("/said", "std_msgs/msg/String", typestore=store)
    for k in range(3):
        writer.write(topic, k + 1, store.serialize_cdr(text(str(k)), "std_msgs/msg/String"))
path = next(Path("bag").glob("*.db3"))
# A recorder with the pragmas of the preset, which writes seven messages more and is killed.
recorder = f"""
import os, sqlite3
base = sqlite3.connect({str(path)!r}, isolation_level=None)
base.execute("PRAGMA journal_mode=WAL")
for k in range(7):
    base.execute("INSERT INTO messages (topic_id, timestamp, data) "
                 "SELECT topic_id, ?, data FROM messages WHERE id = 1", (k + 4,))
os._exit(0)
"""
subprocess.run([sys.executable, "-c", recorder], check=True)
assert os.path.getsize(f"{path}-wal") > 0
# The library first: whoever opens the database as SQLite does brings the log into the file.
reader = Reader.STORAGE_PLUGINS[".db3"](path)
reader.open()
by_library = sum(1 for _ in reader.messages(reader.connections))
reader.close()
base = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
((by_sqlite,),) = base.execute("SELECT count(*) FROM messages")
base.close()
print(f"rosbags {version('rosbags')}: {by_library} messages; SQLite {sqlite3.sqlite_version}: {by_sqlite}")
sys.exit(0 if (by_library, by_sqlite) == (3, 10) else "expected 3 and 10")
PY
