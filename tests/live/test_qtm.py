"""A recording over loopback, spoken to by the maker's own client."""

import contextlib
import socket
import threading

import numpy as np
import pytest

from besman.exceptions import RecordingError, WebError
from besman.live import qtm_source
from besman.live.play_qtm import Delays, play_as_qtm
from besman.live.qtm_source import QtmSource
from besman.records import Recording

pytest.importorskip("qtm_rt", reason="the extra qualisys is not installed")


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """Wait for an answer as long as a busy machine may need."""
    monkeypatch.setattr(qtm_source, "_ANSWER_S", 60.0)
    monkeypatch.setattr(qtm_source, "_OPENED_S", 240.0)


def make_recording(n=40, names=("hand", "el & bow")):
    positions = np.random.default_rng(4).normal(size=(n, len(names), 3))
    positions[3, 1] = np.nan
    return Recording(np.arange(n) / 100, positions, names, 100.0, "x")


@contextlib.contextmanager
def served(recording, delays=Delays(pace=20.0), port=0):  # noqa: B008
    """Serve a recording in a thread; give its port."""
    said, heard = [], threading.Event()

    def say(line):
        said.append(line)
        heard.set()

    thread = threading.Thread(target=play_as_qtm, args=(recording, delays, port, say), daemon=True)
    thread.start()
    assert heard.wait(60)
    yield int(said[0].rpartition(":")[2])
    thread.join(60)
    assert not thread.is_alive()


def read_some(source, n):
    """Read so many packets, however long they take."""
    packets = []
    while len(packets) < n and not source.ended:
        packet = source.read(0.05)
        if packet is not None:
            packets.append(packet)
    return packets


def read_all(source):
    """Read until it is silent; how much that is says how busy the machine is."""
    while not source.ended:
        source.read(0.05)


def test_what_is_played_arrives():
    recording = make_recording()
    with served(recording) as port:
        source = QtmSource("127.0.0.1", port, wait_s=60.0)
        found = source.open()
        assert (found.names, found.rate_hz) == (recording.names, 100.0)
        source.start()
        packets = read_some(source, 40)
        assert source.read(0.05) is None
        source.close()
    assert [one.number for one in packets] == list(range(1, 41))
    np.testing.assert_allclose([one.positions for one in packets], recording.positions, atol=1e-6)
    times = np.array([one.time_s for one in packets])
    np.testing.assert_allclose(np.diff(times), 0.01, atol=2e-6)


def test_what_has_no_name_arrives_with_a_column_for_each_trajectory():
    recording = make_recording(names=(None, None))
    with served(recording) as port:
        source = QtmSource("127.0.0.1", port, wait_s=60.0)
        assert set(source.open().names) == {None}
        source.start()
        packets = read_some(source, 40)
        assert source.read(0.05) is None
        source.close()
    frames = np.array([one.positions for one in packets])
    np.testing.assert_allclose(frames[:, :2], recording.positions, atol=1e-6)
    assert np.isnan(frames[:, 2:]).all()


def test_trajectories_keep_their_columns_whatever_their_order():
    """As the maker's client reads the packet; more than there are columns are left out."""
    from qtm_rt.packet import QRTComponentType

    def packet(numbers):
        points = np.zeros(len(numbers), qtm_source.UNNAMED_MARKER)
        points["number"], points["place"] = numbers, np.array(numbers)[:, None] * 1000.0
        data = len(numbers).to_bytes(4, "little") + bytes(4) + points.tobytes()
        components = {QRTComponentType.Component3dNoLabels: 0}
        return type("Packet", (), {"data": data, "components": components})

    columns = {}
    for numbers in ([7, 3, 9], [9, 7], [12, 9, 7, 3]):
        found = qtm_source.read_unnamed(packet(numbers), columns)
        assert {columns[one]: one for one in numbers} == {
            k: round(found[k, 0]) for k in np.flatnonzero(np.isfinite(found[:, 0]))
        }
        assert (columns[9], columns[7]) == (2, 0)
    assert len(qtm_source.read_unnamed(packet(list(range(1, 99))), {})) == qtm_source.UNNAMED


def test_a_source_that_is_started_again_is_found_again():
    recording = make_recording()
    with served(recording) as port:
        source = QtmSource("127.0.0.1", port, wait_s=60.0)
        source.open()
        source.start()
        packets = read_some(source, 40)
    with served(recording, port=port):
        packets += read_some(source, 40)
    source.close()
    assert [one.number for one in packets] == [*range(1, 41)] * 2


def test_no_server_and_a_wrong_version_are_one_line():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(WebError, match=f"port {port}: cannot be listened at"):
            play_as_qtm(make_recording(), port=port)
    with pytest.raises(RecordingError, match=r"cannot be connected to \(.*expected QTM"):
        QtmSource("127.0.0.1", port).open()
    with served(make_recording()) as port:
        with pytest.raises(RecordingError, match=r"QTM does not speak version 2\.9.*say which"):
            QtmSource("127.0.0.1", port, version="2.9").open()
        # So that it plays, and ends.
        source = QtmSource("127.0.0.1", port, wait_s=0.1)
        source.open()
        source.start()
        read_all(source)
        source.close()


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n"])
def test_a_server_of_something_else_is_one_line(answer, monkeypatch):
    monkeypatch.setattr(qtm_source, "_ANSWER_S", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def talk():
            client, _ = server.accept()
            client.sendall(answer)
            ended.wait(60)
            client.close()

        ended = threading.Event()
        thread = threading.Thread(target=talk, daemon=True)
        thread.start()
        with pytest.raises(RecordingError, match=r"no answer within 0\.3 s.*expected QTM") as error:
            QtmSource("127.0.0.1", server.getsockname()[1]).open()
        ended.set()
        thread.join()
    assert "\n" not in str(error.value)


class Bytes:
    """A packet of qtm_rt that counts more markers than it has."""

    def __init__(self, n_markers, size):
        from qtm_rt.packet import QRTComponentType

        self.components = {QRTComponentType.Component3d: 24}
        self.data = bytes(24) + n_markers.to_bytes(4, "little") + bytes(size - 28)
        self.timestamp, self.framenumber = 0, 1


@pytest.mark.parametrize(("n_markers", "size"), [(2, 55), (2**32 - 1, 56), (1, 28)])
def test_a_packet_shorter_than_it_says_ends_in_words(n_markers, size):
    source = QtmSource("127.0.0.1")
    source._take(Bytes(n_markers, size))
    with pytest.raises(RecordingError, match=rf"a packet of {size} bytes says that it has"):
        source.read(0.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<a/>", "got 3D markers at nan Hz; expected 3D tracking"),
        ("<!DOCTYPE a><a/>", "settings cannot be read: a document type"),
        ("<a>", "settings cannot be read"),
        (
            "<a><General><Frequency>100</Frequency></General><The_3D><AxisUpwards>+W</AxisUpwards>"
            "<Label><Name>hand</Name></Label></The_3D></a>",
            "axis upwards: got 'w'",
        ),
    ],
)
def test_settings_that_cannot_be_used_are_one_line(text, said):
    with pytest.raises(RecordingError, match=said):
        QtmSource("127.0.0.1")._read_format(text)
