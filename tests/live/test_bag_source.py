"""Topics of a bag that is written while they are read."""

import contextlib
import os
import shutil
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import growing_bags
import numpy as np
import pytest
from growing_bags import MOCAP, MOCAP_DEFINITION, McapWriter, SqliteWriter
from ros_bags import Messages, write_bag

from besman.exceptions import RecordingError
from besman.io import ros_points
from besman.io.ros_messages import RawMessage
from besman.live import growing_bag
from besman.live.bag_source import BagSource
from besman.live.growing_mcap import GrowingMcap
from besman.live.growing_sqlite import GrowingSqlite
from besman.live.play_mcap import TOPIC, play_as_mcap
from besman.live.play_qtm import Delays
from besman.live.ros_frames import RosFrames
from besman.records import Recording

pytest.importorskip("rosbags", reason="the extra ros is not installed")
pytest.importorskip("mcap", reason="the extra ros is not installed")

POSE = "geometry_msgs/msg/PoseStamped"
STEP_NS = 10_000_000


def make_recording(names=("hand", "elbow"), n=60):
    positions = np.random.default_rng(4).normal(size=(n, len(names), 3))
    positions[3, 1] = np.nan
    return Recording(np.arange(n) / 100, positions, names, 100.0, "x")


def read_all(source):
    packets = []
    with contextlib.closing(source):
        source.start()
        while not source.ended:
            packet = source.read(0.05)
            if packet is not None:
                packets.append(packet)
    return packets


def poses(n, names=("hand", "elbow"), begin=0, step_ns=STEP_NS):
    """Rows of topics of one body each."""
    make = Messages()
    definition, _ = make.store.generate_msgdef(POSE, ros_version=2)
    for row in range(begin, begin + n):
        at = 10**9 + row * step_ns
        for column, name in enumerate(names):
            message = make.pose(at + 1000 * column, (row, column, 1.0))
            data = bytes(make.store.serialize_cdr(message, POSE))
            yield f"/vrpn/{name}/pose", POSE, definition, at, data


@pytest.mark.parametrize("chunk_bytes", [None, 20_000])
@pytest.mark.parametrize("names", [("hand", "elbow"), (None, None)])
def test_what_is_played_arrives_while_it_is_written(tmp_path, names, chunk_bytes):
    recording, path = make_recording(names), tmp_path / "a.mcap"
    arguments = (recording, path, Delays(pace=4.0), lambda line: None, chunk_bytes)
    thread = threading.Thread(target=play_as_mcap, args=arguments)
    thread.start()
    source = BagSource(path, from_start=True)
    found = source.open()
    packets = read_all(source)
    thread.join()
    assert found.rate_hz == 100.0
    assert TOPIC in found.source
    positions = np.array([one.positions for one in packets])
    np.testing.assert_allclose(np.diff([one.time_s for one in packets]), 0.01, atol=2e-6)
    if names[0]:
        assert found.names == names
        np.testing.assert_allclose(positions, recording.positions, atol=1e-6)
    else:
        assert found.names == (None,) * ros_points.UNNAMED
        np.testing.assert_allclose(positions[:, :2], recording.positions, atol=1e-6)
        assert np.isnan(positions[:, 2:]).all()


def test_only_what_is_new_is_given_but_for_a_bag_that_was_closed(tmp_path):
    path = tmp_path / "a.mcap"
    writer = McapWriter(path)
    for one in poses(40):
        writer.write(*one)
    source = BagSource(path, wait_s=0.3)
    assert source.open().names == ("hand", "elbow")
    for one in poses(5, begin=40):
        writer.write(*one)
    expected = [[[row, column, 1.0] for column in range(2)] for row in range(45)]
    np.testing.assert_array_equal([one.positions for one in read_all(source)], expected[40:])
    writer.finish()
    closed = BagSource(path)
    closed.open()
    np.testing.assert_array_equal([one.positions for one in read_all(closed)], expected)


def test_a_body_that_is_hidden_or_late_does_not_hold_a_frame_back(tmp_path):
    path = tmp_path / "a.mcap"
    rows = list(poses(40))
    del rows[2 * 30 + 1]
    rows.append(rows.pop(2 * 20))
    writer = McapWriter(path)
    for one in rows:
        writer.write(*one)
    writer.finish()
    source = BagSource(path)
    source.open()
    packets = read_all(source)
    seen = np.isfinite([one.positions[:, 0] for one in packets])
    # The last came when its frame was past; it stands alone at the end.
    assert (~seen[:40]).sum(axis=0).tolist() == [1, 1]
    assert len(packets) in (40, 41)


@pytest.mark.parametrize("by_name", [True, False])
def test_definitions_of_the_file_are_read(tmp_path, by_name):
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(MOCAP_DEFINITION.replace("MSG: builtin", "MSG: b"), MOCAP))
    make = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    path = tmp_path / "a.mcap"
    writer = McapWriter(path, 5000, "LZ4")
    for row in range(30):
        at = 10**9 + row * STEP_NS
        header = make["Header"](make["Time"](at // 10**9, at % 10**9), "map")
        markers = [
            make["Marker"](
                0 if by_name else 1, k, name if by_name else "", make["Point"](row, k, 1)
            )
            for k, name in enumerate(("hand", "elbow"))
        ]
        if by_name and row == 7:
            markers[1].translation = make["Point"](0.0, 0.0, 0.0)
        message = make["Markers"](header, 500 + row, markers)
        data = bytes(store.serialize_cdr(message, MOCAP))
        writer.write("/markers", MOCAP, MOCAP_DEFINITION, at, data)
    writer.finish()
    source = BagSource(path)
    found = source.open()
    packets = read_all(source)
    assert [one.number for one in packets] == list(range(500, 530))
    expected = np.array([[[row, k, 1.0] for k in range(2)] for row in range(30)])
    assert found.names[:2] == (("hand", "elbow") if by_name else (None, None))
    if by_name:
        expected[7, 1] = np.nan
    np.testing.assert_array_equal([one.positions[:2] for one in packets], expected)


@pytest.mark.parametrize("journal", ["MEMORY", "WAL"])
def test_a_database_is_read_without_standing_in_its_writers_way(tmp_path, journal, monkeypatch):
    # A busy machine lets this process look seldom, and the writer rests but for a moment.
    monkeypatch.setattr("besman.live.growing_sqlite._TORN_S", 60.0)
    (tmp_path / "bag").mkdir()
    path, enough = tmp_path / "bag" / "a.db3", tmp_path / "enough"
    command = [sys.executable, growing_bags.__file__, path, journal, enough]
    writing = subprocess.Popen(command, stdout=subprocess.PIPE)
    while not path.exists() or not path.stat().st_size:
        assert writing.poll() is None
    growing, found = GrowingSqlite(path), []
    polls_with_news = 0
    try:
        # The writer goes on however seldom this process gets its turn.
        while writing.poll() is None and not (polls_with_news > 5 and len(found) > 300):
            new = growing.read_new()
            polls_with_news += bool(new)
            found += new
    finally:
        enough.touch()
    while writing.poll() is None:
        found += growing.read_new()
    while new := growing.read_new():
        found += new
    # The writer never met a lock; what was read is all of it, in order, and each message whole.
    said, _ = writing.communicate()
    assert writing.returncode == 0
    assert len(found) == int(said)
    expected = [
        growing_bags.point_message(10**9 + row * STEP_NS, float(row))
        for row in range(1, len(found) + 1)
    ]
    assert [one.data for one in found] == expected
    growing.close()
    assert sorted(one.name for one in path.parent.iterdir()) == ["a.db3"]


def test_what_is_written_in_the_same_tick_of_the_clock_is_read(tmp_path):
    """It may change neither the size of the file nor its time."""
    path = tmp_path / "a.db3"
    writer, growing = SqliteWriter(path, "MEMORY"), GrowingSqlite(path)
    sizes = set()
    for row in range(3):
        writer.write_all([("/said", "std_msgs/msg/String", "", row, b"few")])
        os.utime(path, ns=(0, 0))
        sizes.add(path.stat().st_size)
        assert [one.data for one in growing.read_new()] == [b"few"]
        assert growing.read_new() == []
    assert len(sizes) == 1
    writer.close()
    growing.close()


def test_a_database_that_the_same_process_writes(tmp_path):
    path = tmp_path / "a.db3"
    writer = SqliteWriter(path, "WAL")
    writer.write_all(poses(25))
    source = BagSource(path, wait_s=0.3)
    assert source.open().rate_hz == 100.0
    writer.write_all(poses(30, begin=25))
    assert len(read_all(source)) == 30
    writer.close()
    assert not path.with_name("a.db3-wal").exists()


def test_the_index_of_a_log_is_left_to_the_writer(tmp_path):
    """Who comes first makes it, and locks what the writer needs at its beginning."""
    path = tmp_path / "a.db3"
    writer = SqliteWriter(path, "WAL")
    writer.write_all(poses(3))
    growing, index = GrowingSqlite(path), tmp_path / "a.db3-shm"
    whole = index.read_bytes()
    for changed in (bytes(len(whole)), whole[:20], whole[:12] + b"\0" + whole[13:]):
        copy = tmp_path / "b.db3"
        copy.write_bytes(path.read_bytes())
        (tmp_path / "b.db3-wal").write_bytes((tmp_path / "a.db3-wal").read_bytes())
        (tmp_path / "b.db3-shm").write_bytes(changed)
        assert GrowingSqlite(copy).read_new() == []
    assert len(growing.read_new()) == 6
    writer.close()
    growing.close()


@pytest.mark.parametrize("ending", ["mcap", "db3"])
def test_a_bag_that_is_split_is_read_on(tmp_path, ending):
    folder = tmp_path / "bag"
    folder.mkdir()
    last = None
    source = BagSource(folder, from_start=True)

    def write(number, rows):
        path = folder / f"bag_{number}.{ending}"
        writer = McapWriter(path, 3000) if ending == "mcap" else SqliteWriter(path, "WAL")
        if ending == "db3":
            writer.write_all(rows)
        else:
            for one in rows:
                writer.write(*one)
        return writer

    def end(writer):
        writer.finish() if ending == "mcap" else writer.close()

    # As rosbag2 does: the next file is there before this one has its end.
    for number in range(11):
        writer = write(number, poses(30, begin=30 * number))
        if last is not None:
            end(last)
        last = writer
        if number == 1:
            source.open()
    (folder / "metadata.yaml").write_text("")
    end(last)
    packets = read_all(source)
    assert [one.positions[0, 0] for one in packets] == list(range(330))


def test_a_writer_that_is_killed_costs_its_last_chunk(tmp_path, monkeypatch):
    monkeypatch.setattr(growing_bag, "_NEXT_S", 0.1)
    folder = tmp_path / "bag"
    folder.mkdir()
    path = folder / "bag_0.mcap"
    writer = McapWriter(path, 10_000)
    for one in poses(100):
        writer.write(*one)
    writer.abandon()
    whole = path.read_bytes()
    path.write_bytes(whole[:-500])
    source = BagSource(folder, from_start=True, wait_s=0.3)
    source.open()
    packets = read_all(source)
    assert 20 < len(packets) < 100
    assert [one.positions[0, 0] for one in packets] == list(range(len(packets)))
    (folder / "metadata.yaml").write_text("")
    source = BagSource(folder, wait_s=60.0)
    source.open()
    assert len(read_all(source)) == len(packets)


def test_markers_come_before_poses_unless_topics_are_asked_for(tmp_path):
    path = tmp_path / "a.mcap"
    play_as_mcap(make_recording(), path, Delays(pace=1000.0))
    own = tmp_path / "b.mcap"
    make = Messages()
    topics = {
        "/a": [(10**9 + k * STEP_NS, make.pose(10**9 + k * STEP_NS, (k, 0, 1))) for k in range(30)],
        "/tf": [
            (10**9 + k * STEP_NS, make.frames(
                make.transform(10**9 + k * STEP_NS, "b", "world", (k, 1, 1)),
                make.transform(10**9 + k * STEP_NS, "c", "world", (k, 2, 1)),
            )) for k in range(30)
        ],
        "/tf_static": [(10**9, make.frames(make.transform(0, "world", "top", (0, 0, 0))))],
    }  # fmt: skip
    write_bag(own, topics)
    assert BagSource(path).open().names == ("hand", "elbow")
    assert BagSource(own).open().names == ("a",)
    source = BagSource(own, ("/tf",))
    assert source.open().names == ("b", "c")
    assert np.array([one.positions for one in read_all(source)])[:, :, 0].tolist() == [
        [k, k] for k in range(30)
    ]


def test_units_and_axis_that_are_not_those_of_ros(tmp_path):
    path, recording = tmp_path / "a.mcap", make_recording(n=30)
    play_as_mcap(recording, path, Delays(pace=1000.0))
    source = BagSource(path, units="mm", up="y")
    source.open()
    found = np.array([one.positions for one in read_all(source)])
    x, y, z = np.moveaxis(recording.positions, 2, 0)
    np.testing.assert_allclose(found, 1e-3 * np.stack([x, -z, y], axis=2), atol=1e-8)


def test_what_cannot_be_followed_is_one_line(tmp_path):
    def refuse(source, said):
        with pytest.raises(RecordingError, match=said) as error:
            source.open()
        assert "\n" not in str(error.value)

    make, wait_s = Messages(), 0.2
    refuse(BagSource(tmp_path / "no", wait_s=wait_s), r"no bag there within 0\.2 s; expected an")
    text = tmp_path / "text.mcap"
    text.write_text("a file of text, long enough")
    refuse(BagSource(text, wait_s=wait_s), "is no MCAP file")
    some = write_bag(
        tmp_path / "some.mcap",
        {"/said": [(k * STEP_NS, make.text("hello")) for k in range(300)]},
    )
    refuse(BagSource(some), r"no topic of markers; expected one of mocap4r2_msgs/Markers, .*/said")
    few = write_bag(tmp_path / "few.mcap", {"/p": [(1, make.pose(1, (0, 0, 0)))]})
    refuse(BagSource(few, wait_s=wait_s), "no more than 1 messages; expected markers at some rate")
    two = {
        f"/{name}": [
            (k * STEP_NS, make.pose(1 + k * STEP_NS, (0, 0, 1), frame=name)) for k in range(200)
        ]
        for name in "ab"
    }
    path = write_bag(tmp_path / "two.mcap", two)
    refuse(BagSource(path), "/b: places in the frames 'a' and 'b'; expected one.*topic=NAME")
    refuse(BagSource(path, ("/c",)), "no topic '/c' of markers or poses; did you mean '/b'")
    assert BagSource(path, ("/b",)).open().names == ("b",)
    arrays = {}
    for topic in ("/one", "/two"):
        clouds = (
            make.make(
                "sensor_msgs/msg/PointCloud", header=make.header(1 + k), points=[], channels=[]
            )
            for k in range(200)
        )
        arrays[topic] = [(k * STEP_NS, cloud) for k, cloud in enumerate(clouds)]
    path = write_bag(tmp_path / "arrays.mcap", arrays)
    refuse(BagSource(path), "2 topics have markers: /one, /two; say which: .topic=")
    packed = tmp_path / "packed"
    packed.mkdir()
    shutil.copy(path, packed / "packed_0.mcap.zstd")
    refuse(BagSource(packed, wait_s=wait_s), "compressed as a whole cannot be read while")
    long = tmp_path / "long.mcap"
    long.write_bytes(b"\x89MCAP0\r\n\x06" + (1 << 40).to_bytes(8, "little") + bytes(100))
    refuse(BagSource(long), "a record of 1099511627776 bytes; expected at most")


def test_a_database_that_is_none_or_spoilt_is_one_line(tmp_path, monkeypatch):
    from besman.live import growing_sqlite

    monkeypatch.setattr(growing_sqlite, "_TORN_S", 0.1)
    path = tmp_path / "a.db3"
    writer = SqliteWriter(path, "DELETE")
    writer.write_all(poses(300))
    writer.close()
    whole = path.read_bytes()
    spoilt = tmp_path / "b.db3"
    spoilt.write_bytes(whole[:4096] + bytes(len(whole) - 4096))
    with pytest.raises(RecordingError, match="cannot be read while it is written: "):
        BagSource(spoilt).open()
    # The error's text quotes what is in the file.
    odd = tmp_path / "d.db3"
    odd.write_bytes(whole.replace(b"CREATE TABLE topics", b"CREATE TABL\x9d topics"))
    with pytest.raises(RecordingError, match="cannot be read while it is written: 'utf-8' codec"):
        BagSource(odd).open()
    with pytest.raises(sqlite3.Error):
        sqlite3.connect(spoilt).execute("SELECT data FROM messages").fetchall()
    other = tmp_path / "c.db3"
    sqlite3.connect(other).execute("CREATE TABLE a(b)").connection.close()
    with pytest.raises(RecordingError, match="no more than 0 messages"):
        BagSource(other, wait_s=0.1).open()


def test_a_message_that_is_none_is_one_line(tmp_path):
    path = tmp_path / "a.mcap"
    writer = McapWriter(path)
    for topic, kind, definition, at, data in poses(30):
        writer.write(topic, kind, definition, at, data if at < 1.2e9 else data[:20])
    writer.finish()
    source = BagSource(path)
    with pytest.raises(RecordingError, match="/vrpn/hand/pose: a message is no geometry_msgs"):
        source.open()
    source.close()


def test_files_are_read_in_their_order(tmp_path):
    for name in ("bag_10.mcap", "bag_2.mcap", "bag_0.mcap", "notes.txt"):
        (tmp_path / name).write_text("")
    found = growing_bag.GrowingBag(tmp_path).find_files()
    assert [Path(one).name for one in found] == ["bag_0.mcap", "bag_2.mcap", "bag_10.mcap"]


def test_records_are_read_as_they_become_whole(tmp_path):
    whole, path = tmp_path / "whole.mcap", tmp_path / "a.mcap"
    writer = McapWriter(whole, 2000)
    for one in poses(40):
        writer.write(*one)
    writer.finish()
    data = whole.read_bytes()
    path.write_bytes(b"")
    growing, found, counts = GrowingMcap(path), [], []
    with path.open("ab") as file:
        for at in range(0, len(data), 701):
            file.write(data[at : at + 701])
            file.flush()
            found += growing.read_new()
            counts.append(len(found))
    growing.close()
    assert growing.is_whole
    assert [tuple(one) for one in found] == [
        (topic, kind, at, content) for topic, kind, _, at, content in poses(40)
    ]
    # Chunk by chunk, not at the end alone.
    assert len(set(counts)) > 4


def test_a_cloud_has_no_names():
    make = Messages()
    point = make.store.types["geometry_msgs/msg/Point32"]
    data = {}
    for k in range(25):
        cloud = make.make(
            "sensor_msgs/msg/PointCloud", header=make.header(10**9 + k * STEP_NS),
            points=[point(x=1.0, y=float(k), z=0.0)] * 2, channels=[],
        )  # fmt: skip
        data[k] = bytes(make.store.serialize_cdr(cloud, cloud.__msgtype__))
    messages = [
        RawMessage("/points", "sensor_msgs/msg/PointCloud", k, one) for k, one in data.items()
    ]
    frames = RosFrames("x", ())
    assert frames.describe(messages[:10], {}) is None
    assert frames.describe(messages, {}).names == (None,) * ros_points.UNNAMED
    ((stamp, positions, number),) = frames.take(messages[3])
    assert (stamp, number) == (10**9 + 3 * STEP_NS, None)
    np.testing.assert_array_equal(positions[:2], [[1.0, 3.0, 0.0]] * 2)
    assert np.isnan(positions[2:]).all()
