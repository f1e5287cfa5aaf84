"""What reads live streams: `besman follow --live` and `besman mirror` behind their sources."""

import contextlib
import json
import time
import warnings
from contextlib import nullcontext
from functools import cache
from pathlib import Path
from unittest import mock

import numpy as np
from fuzz import mutations, sense, streams, whole_files
from fuzz.target import Target

from besman.exceptions import RecordingWarning
from besman.live.lsl_source import LslSource
from besman.live.natnet_source import NatNetSource
from besman.live.qtm_source import QtmSource
from besman.live.stream import Packet, StreamFormat


class Told:
    """Packets as a file tells them."""

    def __init__(self, content):
        about = content if isinstance(content, dict) else {}
        self.names = tuple(streams.texts(about.get("names")))
        self.rate_hz = streams.number(about.get("rate_hz"))
        rows = about.get("packets")
        self.rows = [row for row in rows if isinstance(row, list)] if isinstance(rows, list) else []
        self.rows.reverse()

    @property
    def ended(self):
        return not self.rows

    def open(self):
        return StreamFormat("told", self.names, self.rate_hz)

    def start(self):
        pass

    def read(self, timeout_s):
        if not self.rows:
            return None
        number, at, flat = (*self.rows.pop(), None, None, None)[:3]
        # A counter of 32 bits, or none.
        counted = number % 2**32 if type(number) is int else None
        positions = streams.places(flat, len(self.names))
        return Packet(streams.number(at), positions, time.perf_counter(), counted)

    def close(self):
        self.rows = []


class FromBytes(QtmSource):
    """QTM's settings and packets out of files, read by its maker's client."""

    def __init__(self, settings, packets):
        super().__init__("x")
        self._settings, self._packets = settings, packets

    def open(self):
        self._format = self._read_format(self._settings)
        return self._format

    def start(self):
        from qtm_rt.packet import QRTPacket

        data = self._packets
        while len(data) >= 8:
            size, kind = np.frombuffer(data, "<u4", 2).tolist()
            if size < 8 or len(data) < size or kind > 9:
                break
            try:
                packet = QRTPacket(data[8:size]) if kind == 3 else None
            except Exception:
                # So the client ends the connection.
                break
            if packet is not None:
                self._take(packet)
            data = data[size:]
        self._inbox.put(None)


class FromDatagrams(NatNetSource):
    """Datagrams out of a file, heard as from the link's thread."""

    def __init__(self, datagrams):
        super().__init__("x")
        self._datagrams = datagrams

    def open(self):
        for one in self._datagrams:
            self.hear(one)
        self._inbox.put(None)
        return self.describe()


class FromChannels(LslSource):
    """Channels and samples out of a file, received by the thread's own function."""

    def __init__(self, content):
        super().__init__("x")
        self._content = content if isinstance(content, dict) else {}

    def open(self):
        found, self._columns, self._scale = self._describe(Announced(self._content))
        return found

    def start(self):
        self._receive(Announced(self._content), self._columns, self._scale)


class Announced:
    """A stream of pylsl: what is told of it, and its samples."""

    def __init__(self, about):
        self._about = about
        self._n = len(streams.texts(about.get("labels")))
        rows = about.get("samples")
        self._rows = (
            [row for row in rows if isinstance(row, list)] if isinstance(rows, list) else []
        )
        self._rows.reverse()

    def _texts(self, key):
        return streams.texts(self._about.get(key)) or None

    def get_channel_labels(self):
        return self._texts("labels")

    def get_channel_types(self):
        return self._texts("types")

    def get_channel_units(self):
        return self._texts("units")

    def channel_count(self):
        return self._n

    def nominal_srate(self):
        return streams.number(self._about.get("rate_hz"))

    def pull_sample(self, timeout_s):
        from pylsl.util import LostError

        if not self._rows:
            raise LostError("x")
        at, flat = (*self._rows.pop(), None, None)[:2]
        values = flat if isinstance(flat, list) else []
        if any(isinstance(one, str) for one in values):
            # A stream of strings.
            return np.array([str(one).encode() for one in values], object), streams.number(at)
        return np.array([streams.number(one) for one in values][: self._n]), streams.number(at)

    def close_stream(self):
        pass


@cache
def _plan():
    """Follow by a model of nothing but where the hand is."""
    import tempfile

    from besman.following.plans import FollowPlan
    from besman.stages.recognize.model_files import load_model
    from besman.stages.segment.stage import VmciOnlineConfig

    with tempfile.TemporaryDirectory() as name:
        for file, content in whole_files.model("nearest_neighbour").items():
            (Path(name) / file).write_bytes(content)
        model = load_model(Path(name) / "m.npz")
    return FollowPlan(((model, ()),), segment=VmciOnlineConfig(calibration_s=0.5))


class _Frames:
    """A follower that keeps what it is given."""

    def __init__(self, follower):
        self._follower, self.frames = follower, []

    def __getattr__(self, name):
        return getattr(self._follower, name)

    def push(self, markers):
        self.frames.append(markers.copy())
        return self._follower.push(markers)


def follow(source, folder):
    """Follow and record a stream; return lines, frames, rate and the recording's file."""
    from besman.exceptions import BesmanError
    from besman.following.hand_stream import HandStream
    from besman.following.live import LiveFollower
    from besman.live.capture import CaptureFile

    capture = folder / "out.tsv"
    follower = LiveFollower(source, _plan())
    found = follower.open(lambda names, rate_hz: CaptureFile(capture, names, rate_hz))
    follower.follower = frames = _Frames(follower.follower)
    with mock.patch("besman.following.frame_stream.keep_meanwhile", nullcontext):
        # To collect garbage before each stream takes longer than to follow it.
        lines = list(follower.run())
    for line in lines:
        if line.get("kind") == "notice":
            warnings.warn(line["text"], RecordingWarning, stacklevel=1)
    hand = HandStream(follower._stream.blank, "right")
    try:
        poses = [hand.take(one) for one in frames.frames]
    except BesmanError:
        poses = []
    return lines, frames.frames, [one for one in poses if one is not None], found.rate_hz, capture


def follow_told(folder):
    return follow(Told(json.loads((folder / "a.json").read_bytes())), folder)


def follow_qtm(folder):
    return follow(
        FromBytes((folder / "a.xml").read_bytes(), (folder / "a.bin").read_bytes()), folder
    )


def follow_natnet(folder):
    return follow(FromDatagrams(streams.split((folder / "a.bin").read_bytes())), folder)


def follow_lsl(folder):
    return follow(FromChannels(json.loads((folder / "a.json").read_bytes())), folder)


def of_stream(folder, found):
    """Return what is nonsense in what was followed and recorded."""
    from besman.cli.live import _finite

    lines, frames, poses, rate_hz, capture = found
    problems = set()
    if not 1 <= rate_hz <= 10_000:
        problems.add(f"a rate of {rate_hz:g} Hz")
    for line in lines:
        try:
            text = json.dumps(_finite(line), allow_nan=False)
        except ValueError:
            problems.add("a line that is no JSON")
        else:
            problems |= {"control characters in a line"} if not text.isprintable() else set()
    track = np.array(frames)
    seen = np.abs(track[np.isfinite(track)])
    if np.isinf(track).any() or (seen > sense.FARTHEST_M).any():
        problems.add("coordinates beyond 1 km")
    elif (np.linalg.norm(np.diff(track, axis=0), axis=2) * rate_hz > sense.FASTEST_M_S).any():
        problems.add("faster than sound")
    if any(not np.isfinite(one).all() for one in poses):
        problems.add("a hand that is nowhere")
    return sorted(problems | set(of_capture(capture, len(frames))))


def of_capture(path, n_frames):
    """Return why what was recorded cannot be read again."""
    from besman.exceptions import BesmanError
    from besman.io.recordings.formats import read_recording

    if n_frames < 2:
        return []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RecordingWarning)
        try:
            n_read = len(read_recording(path).time)
        except BesmanError as error:
            return [f"what was recorded cannot be read: {error}"]
    return [] if n_read == n_frames else [f"{n_read} of {n_frames} frames recorded"]


def find_source(folder):
    """Make a source of an address; open it if it is a file."""
    from besman.live import addresses
    from besman.live.file_source import FileSource

    text = (folder / "address.txt").read_bytes().decode("utf-8", "surrogateescape")
    source = addresses.find_source(text)
    if isinstance(source, FileSource):
        with contextlib.chdir(folder):
            source.open()
    return text, source


def of_address(folder, found):
    text, source = found
    numbers = [value for value in vars(source).values() if type(value) in (int, float)]
    problems = [] if all(0 <= one <= 1e6 for one in numbers) else ["a number out of all sense"]
    asked = text.partition("?")[2]
    if any(sense.odd_digits(one.partition("=")[2]) for one in asked.split("&") if "id" not in one):
        problems.append("digits that are none")
    return problems


def address(text):
    return Target(
        lambda: {"address.txt": text.encode(), **whole_files.named()},
        {"address.txt": mutations.text},
        find_source,
        of_address,
        1,
    )


STREAMS = {
    "stream": Target(streams.stream, {"a.json": streams.break_stream}, follow_told, of_stream, 6),
    "stream of QTM": Target(
        streams.qtm,
        {"a.xml": mutations.xml_file, "a.bin": streams.break_packets},
        follow_qtm,
        of_stream,
        4,
    ),
    "stream of NatNet": Target(
        streams.natnet, {"a.bin": streams.break_datagrams}, follow_natnet, of_stream, 4
    ),
    "stream of LSL": Target(
        streams.lsl, {"a.json": streams.break_stream}, follow_lsl, of_stream, 4
    ),
    "address qtm": address("qtm://192.168.0.7:22223?version=1.19&wait=3"),
    "address lsl": address("lsl:besman?source_id=left&wait=5"),
    "address file": address("file://a.tsv?pace=0.5"),
}
