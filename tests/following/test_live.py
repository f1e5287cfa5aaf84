"""`besman follow --live`: what is followed of a stream is what is followed of the recording."""

import errno
import json
import os
import sys
import time

import numpy as np
import pytest

from besman.cli import main as cli
from besman.config.resources import resource_folder
from besman.exceptions import BesmanError, ConfigError, RecordingError
from besman.following.files import Replay
from besman.following.live import LiveFollower
from besman.following.plans import label_by_names, make_plan
from besman.following.stream_labels import StreamChecks, StreamLabels
from besman.io.recordings.formats import read_recording, write_recording
from besman.live.file_source import FileSource
from besman.live.playing import schedule_frames
from besman.live.stream import Packet, StreamFormat
from besman.person.marker_set import load_marker_set
from besman.standalone.train_files import train_files

SAMPLE = resource_folder("data") / "stick_throw" / "subject1.tsv"


class Network:
    """Frames of a recording as a network delivers them, on a clock that need not be waited for."""

    def __init__(self, recording, rows, times, numbers=None):
        self.recording = recording
        self.packets = [
            Packet(at, recording.positions[row], at, int(row if numbers is None else numbers[k]))
            for k, (row, at) in enumerate(zip(rows, times, strict=True))
        ]
        self.ended = False

    def open(self):
        return StreamFormat("network", self.recording.names, self.recording.rate_hz)

    def start(self):
        self.packets.reverse()

    def read(self, timeout_s):
        packet = self.packets.pop()
        self.ended = not self.packets
        return packet

    def close(self):
        self.packets = []


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    path, _ = train_files([SAMPLE], tmp_path_factory.mktemp("model") / "m", "right_arm", ())
    return make_plan(None, [path], calibration_s=4.0)


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    """The first seconds of the sample as a file."""
    recording = read_recording(SAMPLE)
    n = round(14.0 * recording.rate_hz)
    changes = {"time": recording.time[:n], "positions": recording.positions[:n]}
    path = tmp_path_factory.mktemp("start") / "start.tsv"
    write_recording(type(recording)(**{**vars(recording), **changes}), path)
    return path


@pytest.fixture(scope="module")
def expected(plan, start):
    replay = Replay(start, plan)
    list(replay.run())
    return replay.content()


def follow(source, plan):
    follower = LiveFollower(source, plan)
    follower.open()
    lines = list(follower.run())
    return lines, [
        (one.label, one.start, one.end) for one in follower.follower.state.blocks["right"]
    ]


def blocks_of(expected):
    return [
        (one["label"], one["frames"][0] - 1, one["frames"][1] - 1)
        for one in expected["blocks"]["right"]
    ]


def test_a_file_as_a_stream_is_followed_as_a_file(plan, start, expected):
    lines, blocks = follow(FileSource(start, 0.0), plan)
    assert blocks == blocks_of(expected)
    changes = [one for one in lines if "status" in one]
    assert [
        {key: one[key] for key in ("time_s", "status", "label", "start_s")} for one in changes
    ] == [
        {key: one[key] for key in ("time_s", "status", "label", "start_s")}
        for one in expected["changes"]
    ]
    assert lines[-1]["kind"] == "end"
    assert lines[-1]["frames"] == expected["n_samples"]


def borders_f1(found, truth, margin):
    a, b = ([start for _, start, _ in blocks[1:]] for blocks in (found, truth))
    hits = sum(any(abs(one - other) <= margin for other in b) for one in a)
    return 2 * hits / (len(a) + len(b))


@pytest.mark.parametrize(("lose", "late_s"), [(0.01, 0.0), (0.01, 0.05)])
def test_what_gets_lost_or_comes_late_costs_no_block(plan, start, expected, lose, late_s):
    recording = read_recording(start)
    times, rows = schedule_frames(
        len(recording.time), recording.rate_hz, lose=lose, late_s=late_s, seed=7
    )
    lines, blocks = follow(Network(recording, rows, times), plan)
    truth = blocks_of(expected)
    assert [one[0] for one in blocks] == [one[0] for one in truth]
    assert borders_f1(blocks, truth, 0.1 * recording.rate_hz) >= 0.98
    assert lines[-1]["lost"] == len(recording.time) - len(rows)
    assert lines[-1]["late"] == 0


def test_a_source_that_starts_again_is_followed_on(plan, start, expected):
    recording = read_recording(start)
    n = len(recording.time)
    # It rests from 433 to 633; away from 480 on for a second, then its frames count from 0.
    rows = np.r_[:480, 580:n]
    numbers = np.r_[:480, : n - 580]
    lines, blocks = follow(Network(recording, rows, rows / recording.rate_hz, numbers), plan)
    assert {"kind": "notice", "text": "the source began anew"} in lines
    assert lines[-1]["restarts"] == 1
    assert lines[-1]["frames"] == n
    truth = [one for one in blocks_of(expected) if one[1] > 600]
    assert [one[0] for one in blocks if one[1] > 600] == [one[0] for one in truth]


def test_what_is_no_person_in_metres_is_one_line(plan, start):
    recording = read_recording(start)
    n = 150
    rows, times = np.arange(n), np.arange(n) / 100

    def changed(positions):
        return Network(type(recording)(**{**vars(recording), "positions": positions}), rows, times)

    with pytest.raises(RecordingError, match=r"required markers are [\d.]+ m apart.*--units"):
        follow(changed(recording.positions * 20), plan)
    with pytest.raises(RecordingError, match=r"half of the coordinates .* beyond 100 m.*--units"):
        follow(changed(recording.positions * 1000), plan)
    spaced = Network(recording, rows, times)
    spaced.open = lambda: StreamFormat("x", (" Stick ", *recording.names[1:]), 100.0)
    with pytest.raises(RecordingError, match="are named 'Stick'"):
        follow(spaced, plan)
    for names, said in (("a\nb", "has the control character U"), ("Stick", "are named .Stick.")):
        odd = Network(recording, rows, times)
        odd.open = lambda names=names: StreamFormat("x", (names, *recording.names[1:]), 100.0)
        with pytest.raises(RecordingError, match=said):
            follow(odd, plan)
    slow = Network(recording, rows, times)
    slow.open = lambda: StreamFormat("x", recording.names, 0.01)
    with pytest.raises(RecordingError, match=r"x: 0\.01 frames a second; expected 1 to 10000"):
        follow(slow, plan)
    few = Network(recording, rows, times)
    few.open = lambda: StreamFormat("network", ("a", *recording.names[1:]), 100.0)
    with pytest.raises(BesmanError, match="back_top"):
        follow(few, plan)
    hidden = recording.positions.copy()
    hidden[:, 5] = np.nan
    network = Network(
        type(recording)(**{**vars(recording), "positions": hidden}),
        np.arange(300),
        np.arange(300) / 100,
    )
    follower = LiveFollower(network, plan)
    follower.open()
    lines = []
    with pytest.raises(RecordingError, match="ended before every required marker was seen"):
        lines.extend(follower.run())
    assert lines == [{"kind": "notice", "text": "waiting until marker hand_top is seen"}]


@pytest.mark.parametrize("up", ["x", "y", "-z", None])
def test_an_axis_that_is_not_z_is_told_by_earlier_recordings(start, up):
    recording = read_recording(start)
    marker_set = load_marker_set("right_arm")
    stream = StreamFormat("network", recording.names, recording.rate_hz)
    earlier = label_by_names(read_recording(SAMPLE), marker_set)
    checks = StreamChecks(stream, StreamLabels(stream, marker_set), earlier)
    # As if the frame of the laboratory lay otherwise: what is z here is the axis that is up there.
    order = {"x": [2, 0, 1], "y": [1, 2, 0]}.get(up, [0, 1, 2])
    positions = recording.positions[:, :, order] * (-1 if up == "-z" else 1)
    if up is None:
        for frame in positions:
            checks.look_at(frame)
        return
    for frame in positions[:100]:
        checks.look_at(frame)
    with pytest.raises(RecordingError, match=f"network: {up} points up, as .*--up"):
        checks.look_at(positions[100])


def call(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["besman", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    return stop.value.code or 0


def test_the_command_prints_and_records(monkeypatch, capsys, tmp_path, plan, start):
    model = tmp_path / "m"
    path, _ = train_files([SAMPLE], model, "right_arm", ())
    options = ("--model", path, "--calibration", 4)
    record = tmp_path / "session.tsv"
    source = f"file://{start}?pace=0"
    assert call(monkeypatch, "follow", "--live", source, *options, "--record", record) == 0
    out = capsys.readouterr().out
    lines = [json.loads(line) for line in out.splitlines()]
    assert lines[0]["kind"] == "stream"
    assert lines[-1]["kind"] == "end"
    assert (tmp_path / "session.jsonl").read_text() == out
    recorded, given = read_recording(record), read_recording(start)
    np.testing.assert_allclose(recorded.positions, given.positions, atol=1e-6)
    # The disk is full: the stream is followed on, what was recorded is whole, and it is an error.
    left, write = [100_000], os.pwrite

    def write_until_full(file, data, at):
        left[0] -= len(data)
        if left[0] < 0 and data[:1].isdigit():
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(file, data, at)

    monkeypatch.setattr(os, "pwrite", write_until_full)
    other = tmp_path / "other.tsv"
    assert call(monkeypatch, "follow", "--live", source, *options, "--record", other) == 2
    monkeypatch.undo()
    told = capsys.readouterr()
    assert "other.tsv: cannot be written: No space left on device; what was recorded" in told.err
    assert [json.loads(line)["kind"] for line in told.out.splitlines()][-1] == "end"
    n = len(read_recording(other).time)
    assert 0 < n < len(given.time)


def test_options_that_do_not_go_together_are_one_line(tmp_path, monkeypatch, capsys):
    for arguments, said in (
        (("follow",), "expected either a recording or --live SOURCE"),
        (("follow", "a.tsv", "--live", "lsl:x"), "expected either a recording or --live SOURCE"),
        (("follow", "a.tsv", "--record", "b.tsv"), "--record: is of a live stream"),
        (("play", SAMPLE, "--as", "vicon"), "--as: got 'vicon'; expected qtm, lsl, natnet or mcap"),
    ):
        assert call(monkeypatch, *arguments) == 2
        assert said in capsys.readouterr().err


def test_a_paced_file_keeps_its_pace(start):
    source = FileSource(start, 20.0)
    source.open()
    source.start()
    begun = time.perf_counter()
    times = []
    while len(times) < 200:
        packet = source.read(0.05)
        if packet is not None:
            times.append(packet.arrived_s - begun)
    # Never before it is due.
    assert np.all(np.array(times) >= np.arange(200) / (100 * 20.0) - 1e-4)
    with pytest.raises(ConfigError):
        schedule_frames(1, 100.0, pace=0.0)


def test_a_stream_without_names_is_followed_as_one_with_names(plan, start):
    named = read_recording(start)
    order = np.random.default_rng(2).permutation(len(named.names))
    changes = {"positions": named.positions[:, order], "names": (None,) * len(order)}
    unnamed = type(named)(**{**vars(named), **changes})
    rows = np.arange(len(named.time))
    lines, blocks = follow(Network(unnamed, rows, rows / named.rate_hz), plan)
    told = [one for line in lines if line["kind"] == "names" for one in line["changes"]]
    columns = load_marker_set("right_arm").match(named.names, named.source)
    names = {one["marker"]: named.names[order[one["trajectory"]]] for one in told}
    # The set's own pose tells nothing of the stick.
    body = {marker: column for marker, column in columns.items() if marker != "stick"}
    assert names == {marker: named.names[column] for marker, column in body.items()}
    assert lines[0]["kind"] == "names"
    assert all(0 <= one["for_s"] <= 0.5 and one["confidence"] >= 0.8 for one in told)
    # It begins when a person was found, some frames later.
    late = len(named.time) - lines[-1]["frames"]
    assert 0 <= late <= 0.2 * named.rate_hz
    _, truth = follow(Network(named, rows[late:], rows[late:] / named.rate_hz), plan)
    assert blocks == truth


def test_points_without_names_that_are_all_hidden_for_a_while(plan, start):
    """A stretch in which there is nothing to look at has no part in who is who."""
    named = read_recording(start)
    n = 1300
    positions = named.positions[:n].copy()
    # So many rows are given where a source counts on by more.
    positions[8:1008] = np.nan
    changes = {"positions": positions, "names": (None,) * len(named.names), "time": named.time[:n]}
    unnamed = type(named)(**{**vars(named), **changes})
    follower = LiveFollower(Network(unnamed, np.arange(n), np.arange(n) / 100), plan)
    follower.open()
    lines = list(follower.run())
    assert [one["kind"] for one in lines[:2]] == ["notice", "names"]
    assert lines[-1]["frames"] > 100


def test_unnamed_points_that_are_no_person_are_told_of(plan, start):
    recording = read_recording(start)
    n = round(3 * recording.rate_hz)
    some = np.random.default_rng(0).normal(size=(n, 9, 3))
    changes = {"positions": some, "names": (None,) * 9, "time": recording.time[:n]}
    nobody = type(recording)(**{**vars(recording), **changes})
    follower = LiveFollower(Network(nobody, np.arange(n), np.arange(n) / 100), plan)
    follower.open()
    lines = []
    with pytest.raises(RecordingError, match=r"marker was seen together: . of 8 required markers"):
        lines.extend(follower.run())
