"""A recording over Lab Streaming Layer, on this machine alone."""

import threading
import uuid

import numpy as np
import pytest

from besman.exceptions import RecordingError
from besman.live import lsl_source
from besman.live.lsl_source import LslSource
from besman.live.play_lsl import announce_only_here, play_as_lsl
from besman.live.play_qtm import Delays
from besman.records import Recording

pylsl = pytest.importorskip("pylsl", reason="the extra lsl is not installed")
announce_only_here()
from pylsl.util import LostError  # noqa: E402

# Streams of all programs of this machine are found.
OWN = f"besman_{uuid.uuid4().hex}"


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """Look for a stream as long as a busy machine may need."""
    monkeypatch.setattr(lsl_source, "_FIND_S", 60.0)


def announce(name, source_id, labels, units, rate_hz=100.0):
    about = pylsl.StreamInfo(name, "MoCap", len(labels), rate_hz, "float32", source_id)
    about.set_channel_labels(labels)
    if units:
        about.set_channel_units(units)
    return pylsl.StreamOutlet(about)


def test_what_is_played_arrives():
    positions = np.random.default_rng(4).normal(size=(40, 2, 3))
    positions[3, 1] = np.nan
    recording = Recording(np.arange(40) / 100, positions, ("hand top", "elbow"), 100.0, "x")
    player = threading.Thread(
        target=play_as_lsl, args=(recording, OWN, Delays(pace=4.0)), daemon=True
    )
    player.start()
    source = LslSource(OWN, wait_s=60.0)
    found = source.open()
    assert (found.names, found.rate_hz) == (recording.names, 100.0)
    source.start()
    packets = []
    while len(packets) < 40 and not source.ended:
        packet = source.read(0.1)
        if packet is not None:
            packets.append(packet)
    source.close()
    player.join(60)
    assert not player.is_alive()
    np.testing.assert_allclose([one.positions for one in packets], positions, atol=1e-6)
    np.testing.assert_allclose(np.diff([one.time_s for one in packets]), 0.01, atol=1e-3)


class Inlet:
    """Samples, then an error."""

    def __init__(self, samples, error):
        self._samples, self._error = samples, error

    def pull_sample(self, timeout_s):
        if self._samples:
            return self._samples.pop(0), 1.0
        raise self._error


def test_a_stream_that_is_lost_has_ended():
    source = LslSource("x", wait_s=1e6)
    source._receive(Inlet([np.zeros(3)], LostError("lost")), [[0, 1, 2]], 1.0)
    assert source.read(0.0) is not None
    assert source.read(0.0) is None
    assert source.ended


@pytest.mark.parametrize("sample", [np.array([b"a", b"b", b"c"], object), np.zeros(2)])
def test_samples_that_are_no_coordinates_end_in_words(sample):
    source = LslSource("x")
    source._receive(Inlet([sample], None), [[0, 1, 2]], 1.0)
    with pytest.raises(RecordingError, match="lsl:x: "):
        source.read(0.0)


def test_channels_without_labels_are_points_without_names():
    outlet = announce(f"{OWN}_dots", "one", [""] * 6, ["mm"] * 6)
    source = LslSource(f"{OWN}_dots")
    assert source.open().names == (None, None)
    source.start()
    assert outlet.wait_for_consumers(60)
    outlet.push_sample([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    packet = source.read(60.0)
    source.close()
    np.testing.assert_allclose(packet.positions, [[1e-3, 2e-3, 3e-3], [4e-3, 5e-3, 6e-3]])


def test_other_units_and_axes_are_turned():
    labels = [f"hand.{axis}" for axis in "xyz"] + ["battery"]
    outlet = announce(f"{OWN}_mm", "one", labels, ["mm"] * 3 + ["percent"])
    source = LslSource(f"{OWN}_mm", up="y")
    assert source.open().names == ("hand",)
    source.start()
    assert outlet.wait_for_consumers(60)
    outlet.push_sample([1000.0, 2000.0, 3000.0, 50.0])
    packet = source.read(60.0)
    source.close()
    # What was y is z; x stays.
    np.testing.assert_allclose(packet.positions, [[1.0, -3.0, 2.0]])


def test_streams_that_cannot_be_used_are_one_line(monkeypatch):
    with monkeypatch.context() as soon:
        soon.setattr(lsl_source, "_FIND_S", 0.5)
        with pytest.raises(RecordingError, match=r"no such stream was found within 0\.5 s"):
            LslSource(f"{OWN}_nowhere").open()
    # Of one name there are two, at the latest then; of the next ones there is one.
    monkeypatch.setattr(lsl_source, "_SECOND_S", 60.0)
    labels = [f"hand_{axis}" for axis in "XYZ"]
    first = announce(f"{OWN}_two", "left", labels, ["m"] * 3)
    second = announce(f"{OWN}_two", "right", labels, None)
    with pytest.raises(RecordingError, match=r"2 streams have this name: .*say which"):
        LslSource(f"{OWN}_two").open()
    with pytest.raises(RecordingError, match="channels are in ''; expected one unit of length"):
        LslSource(f"{OWN}_two", "right").open()
    with pytest.raises(RecordingError, match="those of this name have the ids"):
        LslSource(f"{OWN}_two", "middle").open()
    same = [announce(f"{OWN}_same", "z", labels, ["m"] * 3) for _ in range(2)]
    with pytest.raises(RecordingError, match="their ids do not tell them apart: end all but one"):
        LslSource(f"{OWN}_same").open()
    monkeypatch.setattr(lsl_source, "_SECOND_S", 0.1)
    eeg = announce(f"{OWN}_eeg", "x", ["Fp1", "Fp2"], ["uV"] * 2)
    with pytest.raises(RecordingError, match="no channels that are markers; got labels 'Fp1'"):
        LslSource(f"{OWN}_eeg").open()
    uneven = announce(f"{OWN}_uneven", "y", labels, ["m"] * 3, 0.0)
    with pytest.raises(RecordingError, match="says no rate"):
        LslSource(f"{OWN}_uneven").open()
    del first, second, eeg, uneven, same
