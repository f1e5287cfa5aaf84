"""A recording over loopback, spoken to by the package's own client."""

import contextlib
import socket
import threading

import numpy as np
import pytest

from besman.exceptions import RecordingError, WebError
from besman.live import natnet_source
from besman.live.natnet_source import UNNAMED, NatNetSource
from besman.live.play_natnet import play_as_natnet
from besman.live.play_qtm import Delays
from besman.records import Recording

natnet = pytest.importorskip("natnet", reason="the extra optitrack is not installed")


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
    assert heard.wait(10)
    yield int(said[0].rpartition(":")[2])
    thread.join(10)


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
        source = NatNetSource("127.0.0.1", port, wait_s=0.5)
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
        source = NatNetSource("127.0.0.1", port, wait_s=0.5)
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
    with (
        served(make_recording(n=4)) as port,
        pytest.raises(RecordingError, match="sends no frames, or none with a time that rises"),
    ):
        NatNetSource("127.0.0.1", port).open()
