"""A recording over loopback, spoken to by the package's own client."""

import contextlib
import socket
import struct
import threading
import time

import numpy as np
import pytest

from besman.exceptions import RecordingError, WebError
from besman.live import natnet_source
from besman.live.natnet_link import read_datagram
from besman.live.natnet_source import UNNAMED, NatNetSource
from besman.live.play_natnet import play_as_natnet
from besman.live.play_qtm import Delays
from besman.records import Recording

natnet = pytest.importorskip("natnet", reason="the extra optitrack is not installed")


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """Wait for an answer as long as a busy machine may need."""
    monkeypatch.setattr(natnet_source, "_ANSWER_S", 60.0)


def make_recording(names=("hand", "elbow"), n=60):
    positions = np.random.default_rng(4).normal(size=(n, len(names), 3))
    positions[3, 1] = np.nan
    return Recording(np.arange(n) / 100, positions, names, 100.0, "x")


@contextlib.contextmanager
def served(recording, delays=Delays(pace=4.0)):  # noqa: B008
    """Serve a recording in a thread; give its port."""
    said, heard = [], threading.Event()

    def say(line):
        said.append(line)
        heard.set()

    thread = threading.Thread(target=play_as_natnet, args=(recording, delays, 0, say), daemon=True)
    thread.start()
    assert heard.wait(60)
    yield int(said[0].rpartition(":")[2])
    thread.join(60)
    assert not thread.is_alive()


def read_all(source, n):
    packets = []
    while len(packets) < n and not source.ended:
        packet = source.read(0.05)
        if packet is not None:
            packets.append(packet)
    source.close()
    return packets


@pytest.mark.parametrize("names", [("hand", "elbow"), (None, None)])
def test_what_is_played_arrives(names):
    recording = make_recording(names)
    with served(recording) as port:
        source = NatNetSource("127.0.0.1", port, wait_s=60.0)
        found = source.open()
        assert found.names == (names if names[0] else (None,) * UNNAMED)
        assert found.rate_hz == 100.0
        source.start()
        packets = read_all(source, 60)
    assert [one.number for one in packets] == list(range(60))
    positions = np.array([one.positions for one in packets])
    np.testing.assert_allclose(np.diff([one.time_s for one in packets]), 0.01, atol=1e-6)
    seen = positions[:, :2] if names[0] else np.delete(positions[:, :2], 3, axis=0)
    expected = recording.positions if names[0] else np.delete(recording.positions, 3, axis=0)
    np.testing.assert_allclose(seen, expected, atol=1e-6)


def test_the_packages_own_client_understands_what_is_played():
    """What is served is NatNet by another's reading of it, not by besman's alone."""
    recording, frames, described = make_recording(), [], threading.Event()
    with served(recording, Delays(pace=1.0)) as port:
        client = natnet.NatNetClient(command_port=port, use_multicast=False)
        client.on_data_frame_received_event.handlers.append(frames.append)
        client.on_data_description_received_event.handlers.append(lambda one: described.set())
        client.connect(60.0)
        client.run_async()
        client.request_modeldef()
        assert described.wait(60.0)
    until = time.monotonic() + 60
    while len(frames) < 60 and time.monotonic() < until:
        time.sleep(0.01)
    client.shutdown()
    assert [one.prefix.frame_number for one in frames] == list(range(60))
    (markers,) = frames[10].marker_sets
    np.testing.assert_allclose(
        markers.marker_pos_list, recording.positions[10][:, [0, 2, 1]] * [1, 1, -1], atol=1e-6
    )


def test_datagrams_that_are_none_are_one_line():
    recording = make_recording()
    with served(recording) as port:
        source = NatNetSource("127.0.0.1", port, wait_s=60.0)
        source.open()
        packets = read_all(source, 60)
    assert len(packets) == 60
    head = struct.pack("<HH", 1, 264) + b"x".ljust(256, b"\0") + bytes((1, 0, 0, 0, 3, 1, 0, 0))
    model = struct.pack("<HHII2sI", 5, 14, 1, 0, b"a", 2**32 - 1)
    for data, said in (
        (b"\x07", "a datagram of 1 bytes cannot be read: it says that it has 65536"),
        (
            struct.pack("<HH", 7, 99) + bytes(20),
            "of 24 bytes cannot be read: it says that it has 99",
        ),
        (struct.pack("<HHII", 7, 8, 3, 2**31), "of 12 bytes cannot be read: 1 bytes more at 12"),
        (model, "of 18 bytes cannot be read: 1 bytes more at 18"),
    ):
        source = NatNetSource("127.0.0.1")
        source.hear(head)
        source.hear(data)
        with pytest.raises(RecordingError, match="natnet://127.0.0.1:1510: .*" + said) as error:
            source.read(0.0)
        assert "\n" not in str(error.value)
        assert source.ended
    assert read_datagram(head, None).nat_net_protocol_version == natnet.Version(3, 1)
    source = NatNetSource("127.0.0.1")
    # Before the version of the protocol is known, and of a kind that does not matter.
    for data in (struct.pack("<HHI", 7, 4, 3), struct.pack("<HH", 8, 0), head):
        source.hear(data)
    assert source.read(0.0) is None


def test_times_that_tell_no_rate_are_one_line():
    source = NatNetSource("127.0.0.1")
    source._described.set()
    for row in range(20):
        source._measure(row, 5e-324 * (row + 1))
    # Which is no rate: what follows a stream refuses it, as of any source.
    assert source.describe().rate_hz == np.inf


def test_markers_of_several_assets_bear_their_names():
    description = natnet.data_descriptions
    sets = [("Ann", ("hand", "elbow")), ("Box", ("top",)), ("all", ("a", "b", "c"))]
    given = tuple(description.MarkerSetDescription(*one) for one in sets)
    source = NatNetSource("127.0.0.1")
    source._read_names(description.DataDescriptions(given, *[()] * 6))
    assert source._names == ("Ann:hand", "Ann:elbow", "Box:top")


def test_assets_that_change_are_one_line():
    recording = make_recording()
    with served(recording) as port:
        source = NatNetSource("127.0.0.1", port, wait_s=60.0)
        source.open()
        source._sets = (("person", 3),)
        with pytest.raises(RecordingError, match="other markers in a frame than in its descr"):
            read_all(source, 61)
        source.close()


def test_no_server_and_silence_are_one_line(monkeypatch):
    monkeypatch.setattr(natnet_source, "_ANSWER_S", 0.3)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(WebError, match=f"port {port}: cannot be listened at"):
            play_as_natnet(make_recording(), port=port)
        with pytest.raises(RecordingError, match=r"no answer within 0\.3 s.*expected Motive"):
            NatNetSource("127.0.0.1", port).open()
    monkeypatch.setattr(natnet_source, "_ANSWER_S", 60.0)
    source = NatNetSource("127.0.0.1", 0)
    # There are answers at once; for frames that do not come it need not wait.
    monkeypatch.setattr(source._measured, "wait", lambda timeout_s: False)
    with served(make_recording(n=4)) as port:
        source._port = port
        with pytest.raises(RecordingError, match="sends no frames, or none with a time that rises"):
            source.open()
