import sqlite3

import pytest

from besman.exceptions import RecordingError
from besman.io.ros_messages import open_bag

pytest.importorskip("rosbags", reason="the extra ros is not installed")
from ros_bags import EPOCH_NS, Messages, write_bag


@pytest.mark.parametrize("ending", [".mcap", ".db3", ".bag"])
def test_topics_and_messages_of_a_bag(tmp_path, ending):
    make = Messages(ros_1=ending == ".bag")
    rows = [(EPOCH_NS + k * 10**7, make.pose(EPOCH_NS, (k, 0, 0))) for k in range(11)]
    path = write_bag(tmp_path / f"a{ending}", {"/a": rows, "/b": [(EPOCH_NS, make.text("hi"))]})
    with open_bag(path) as bag:
        assert [(one.name, one.n_messages) for one in bag.topics] == [("/a", 11), ("/b", 1)]
        assert bag.topics[0].kind == "geometry_msgs/msg/PoseStamped"
        assert bag.topics[0].rate_hz == pytest.approx(100.0, rel=1e-3)
        read = list(bag.read(bag.topics[:1]))
        assert [(topic, one.pose.position.x) for topic, _, one in read] == [
            ("/a", float(k)) for k in range(11)
        ]
        assert [log_ns for _, log_ns, _ in read] == [log_ns for log_ns, _ in rows]
        assert list(bag.read([])) == []


def test_what_is_no_bag(tmp_path):
    with pytest.raises(RecordingError, match="no such file"), open_bag(tmp_path / "a.mcap"):
        pass
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n")
    with (
        pytest.raises(RecordingError, match="cannot be read as a bag"),
        open_bag(tmp_path / "a.mcap"),
    ):
        pass


def test_a_database_whose_last_messages_are_beside_it(tmp_path):
    make = Messages()
    rows = [(EPOCH_NS + k, make.text("hi")) for k in range(3)]
    path = write_bag(tmp_path / "a.db3", {"/b": rows})
    writer = sqlite3.connect(path, isolation_level=None)
    writer.execute("PRAGMA journal_mode=WAL")
    writer.execute(
        "INSERT INTO messages (topic_id, timestamp, data) SELECT topic_id, 9, data FROM messages"
    )
    with (
        pytest.raises(
            RecordingError, match=r"a\.db3: a\.db3-wal beside it holds what was written last"
        ),
        open_bag(path),
    ):
        pass
    writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    with open_bag(path) as bag:
        assert bag.topics[0].n_messages == 6
    writer.close()
