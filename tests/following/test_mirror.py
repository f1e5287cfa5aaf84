"""`besman mirror`: the arm follows a hand of a stream, within its limits, and rests without one."""

import errno
import json
import shutil
import time
from dataclasses import replace

import numpy as np
import pytest
from command_line import besman

from besman.config.resources import resource_folder
from besman.exceptions import FileError, RecordingError
from besman.following.frame_stream import FrameStream
from besman.following.hand_placement import MirrorPlan, mirror_as_in_run
from besman.following.mirror import Mirror
from besman.io.recordings.formats import read_recording, write_recording
from besman.live.capture import CaptureFile
from besman.live.stream import Packet, StreamFormat
from besman.robot.limits import check_limits

pytest.importorskip("ruckig")

SAMPLE = resource_folder("data") / "stick_throw" / "subject1.tsv"


class Frames:
    """A source of some frames, as fast as they are read; then silence for some reads."""

    def __init__(self, positions, n_silent=0):
        recording = read_recording(SAMPLE)
        self.names, self.rate_hz = recording.names, recording.rate_hz
        self.positions, self.row, self.n_silent = positions, 0, n_silent
        self.ended = self.closed = False

    def open(self):
        return StreamFormat("frames", self.names, self.rate_hz)

    def start(self):
        pass

    def read(self, timeout_s):
        if self.row == len(self.positions):
            time.sleep(timeout_s)
            self.n_silent -= 1
            self.ended = self.n_silent <= 0
            return None
        row, self.row = self.row, self.row + 1
        self.ended = self.row == len(self.positions) and not self.n_silent
        return Packet(row / self.rate_hz, self.positions[row], time.perf_counter(), row)

    def close(self):
        self.closed = True


@pytest.fixture(scope="module")
def positions():
    return read_recording(SAMPLE).positions[:700]


@pytest.fixture(scope="module")
def plan(small_run):
    return mirror_as_in_run(small_run)


def mirror(source, plan, **options):
    given = []
    twin = Mirror(source, plan, take=given.append, **options)
    twin.open()
    lines = list(twin.run())
    return lines, [np.concatenate(parts) for parts in zip(*given, strict=True)]


def states(lines):
    return [one["state"] for one in lines if one["kind"] == "arm"]


def test_a_throw_as_in_the_run_is_within_all_limits(positions, plan):
    lines, samples = mirror(Frames(positions[:450]), plan, by_frames=True)
    assert check_limits(plan.robot, *samples).kept
    assert np.abs(samples[1]).max() > 0.5
    assert np.all(samples[1][-1] == 0.0)
    begin = next(one for one in lines if one["kind"] == "begin")
    assert begin["robot"] == "ur5"
    joints = [one for one in lines if one["kind"] == "joints"]
    assert len(joints) == 450 - 50
    # Told are the set-points of the moment; the simulated arm is where they are.
    told = np.array([one["positions_rad"] for one in joints[1:]])
    np.testing.assert_allclose(told, samples[0][9 : 10 * len(told) : 10], atol=1e-6)
    off = np.abs(
        np.array([one["simulated_rad"] for one in joints]) - [j["positions_rad"] for j in joints]
    )
    assert off.max() < 0.02
    assert lines[-1]["set_points"] == len(samples[0])


def test_a_run_places_the_hand_as_it_did(plan, small_run):
    """Record mapping and placement of the run give the same poses."""
    from besman.pipeline.stored_run import open_run
    from besman.stages.map.demonstration import tool_poses

    stored = open_run(small_run)
    mapping, demonstrations = stored.record("map"), stored.record("select")
    corrected = {one.name for one in mapping.corrected}
    one = next(one for one in mapping.trajectories if one.name not in corrected)
    demonstration = next(other for other in demonstrations if other.name == one.name)
    hand2back = tool_poses(demonstration, plan.robot) @ np.linalg.inv(plan.placement.tcp2hand)
    placed = np.array([plan.placement.apply(pose) for pose in hand2back])
    np.testing.assert_allclose(placed[:, :3, 3], one.poses[:, :3], atol=1e-9)


def test_a_hand_whose_markers_have_no_names_is_followed_as_well(positions, plan):
    source = Frames(positions[:260])
    source.names = (None,) * len(source.names)
    lines, samples = mirror(source, plan, by_frames=True)
    assert check_limits(plan.robot, *samples).kept
    assert lines[0]["kind"] == "names"
    assert "follows" in states(lines)
    assert lines[-1]["hidden"] == 0


def test_a_hidden_hand_brings_the_arm_to_rest_and_a_seen_one_moves_it_again(positions, plan):
    hidden = positions[:450].copy()
    names = read_recording(SAMPLE).names
    hidden[260:330, names.index("Hand top")] = np.nan
    lines, samples = mirror(Frames(hidden), plan, by_frames=True)
    assert check_limits(plan.robot, *samples).kept
    assert states(lines)[1:4] == ["follows", "hidden", "rests"]
    assert "follows" in states(lines)[4:]
    assert lines[-1]["hidden"] == 70
    # It moved when the hand was hidden, and stood still before that was seen again.
    since = 10 * (260 - 51)
    assert np.abs(samples[1][since]).max() > 0.1
    assert np.abs(samples[1][since + 600]).max() == 0.0


def test_a_source_that_says_nothing_brings_the_arm_to_rest(positions, plan):
    """By the clock of this machine, in the middle of a movement."""
    lines, samples = mirror(Frames(positions[:260], n_silent=60), plan)
    assert states(lines)[-1] == "rests"
    assert check_limits(plan.robot, *samples).kept
    assert np.all(samples[1][-1] == 0.0)


def test_the_first_seconds_tell_where_the_hand_goes(positions, robot):
    lines, samples = mirror(
        Frames(positions), MirrorPlan(robot, "right_arm"), learn_s=4.0, by_frames=True
    )
    assert "the hand was seen for 4 s" in lines[0]["text"]
    assert check_limits(robot, *samples).kept
    away = [one["away_m"] for one in lines if one["kind"] == "joints"]
    assert np.median(away) < 0.01


def test_what_ends_too_early_says_what_was_lacking(positions, plan, robot):
    with pytest.raises(RecordingError, match="back and hand were not seen together"):
        mirror(Frames(positions[:30]), plan, by_frames=True)
    with pytest.raises(RecordingError, match=r"the hand was seen for 1\.0 s; expected 10 "):
        mirror(Frames(positions[:150]), MirrorPlan(robot, "right_arm"), by_frames=True)


def test_a_full_disk_does_not_end_the_stream(positions, tmp_path, monkeypatch):
    """The source is read on: it is not closed with the recording."""
    source = Frames(positions[:300])
    stream = FrameStream(source, "right_arm")
    stream.open(lambda names, rate_hz: CaptureFile(tmp_path / "a.tsv", names, rate_hz))
    stream.begin_recording()

    def full(file, data, at):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.pwrite", full)
    frames = []
    told = [
        one | {"closed": source.closed} for one in stream.run(lambda one: frames.append(one) or [])
    ]
    text = (
        f"--record: {tmp_path / 'a.tsv'}: cannot be written: No space left on device; what was "
        "recorded until then is whole; the stream is followed on"
    )
    assert told == [{"kind": "notice", "text": text, "closed": False}]
    assert len(frames) == 300
    with pytest.raises(FileError, match="No space left"):
        stream.raise_failure()


def test_the_command_tells_and_records(small_run, tmp_path, monkeypatch, capsys):
    whole = read_recording(SAMPLE)
    start = replace(whole, time=whole.time[:300], positions=whole.positions[:300])
    sent, record = tmp_path / "sent.tsv", tmp_path / "session.tsv"
    write_recording(start, sent)
    given = ("--live", f"file://{sent}?pace=0", "--run", small_run, "--record", record)
    code = besman(monkeypatch, "mirror", *given)
    assert code == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [one["kind"] for one in lines[:3]] == ["stream", "begin", "joints"]
    assert lines[-1]["kind"] == "end"
    assert [json.loads(one) for one in record.with_suffix(".jsonl").open()] == lines
    given = read_recording(sent)
    np.testing.assert_allclose(read_recording(record).positions, given.positions, atol=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "expected either --run RUN or --robot NAME"),
        (("--run", "a", "--robot", "ur5"), "expected either --run RUN or --robot NAME"),
        (("--run", "a", "--tool", "hook"), "--tool: is of --robot"),
        (("--run", "a", "--learn", "5"), "--learn: is of --robot; with --run the hand's place is"),
        (("--run", "a", "--port", "8000"), "--port: is of --page; expected both, or neither"),
        (("--robot", "ur5", "--to-network"), "--to-network: is of --lsl NAME; expected both"),
        (("--run", "nowhere"), "nowhere: not a run"),
        (("--robot", "ur55"), "no robot 'ur55'"),
        (("--robot", "ur5", "--learn", "0"), "--learn: got 0 s; expected 1 to 600"),
    ],
)
def test_what_cannot_be_mirrored_is_one_line(monkeypatch, capsys, options, message):
    assert besman(monkeypatch, "mirror", "--live", f"file://{SAMPLE}?pace=0", *options) == 2
    assert message in " ".join(capsys.readouterr().err.split())


def test_a_run_that_mapped_nothing_is_one_line(small_run, tmp_path, monkeypatch, capsys):
    run = shutil.copytree(small_run, tmp_path / "run")
    state = json.loads((run / "run.json").read_text())
    state["stages"] = [name for name in state["stages"] if not name.endswith("_map")]
    (run / "run.json").write_text(json.dumps(state))
    assert besman(monkeypatch, "mirror", "--live", f"file://{SAMPLE}", "--run", run) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "no map here: expected a run that is finished" in told
