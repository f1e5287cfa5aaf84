"""The twin that moves while a person does: how long from packet to set-point, and what it exceeds.

``besman play`` serves the embedded sample over loopback from a process of its own, spoken to by the
maker's client; this process mirrors it. Then minutes of the same, there and back, as fast as can
be, with frames in which the hand is hidden or jumps. Every set-point at 1 kHz is checked, after the
fact, by a second dynamics (MuJoCo's inverse) and by differences besides the check of the product.
Last, how far behind the hand the arm is, of the sample and of the same at a third of its speed.
Synthetic: the sample is.

    python benchmarks/mirror.py [RUN] [--robot ur5] [--minutes 8]

RUN is a finished run of ``besman run``: its robot, where it places the hand. Without it, and for
the delay, the placement is learnt from the first seconds, for --robot.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import psutil

from besman.config.resources import resource_folder
from besman.following.hand_placement import MirrorPlan, mirror_as_in_run
from besman.following.mirror import Mirror
from besman.io.recordings.formats import read_recording
from besman.live.file_source import FileSource
from besman.live.qtm_source import QtmSource
from besman.live.stream import Packet, StreamFormat
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.robot.model import load_robot
from besman.robot.mujoco_model import arm_spec

PORT = 22298
SAMPLE = resource_folder("data") / "stick_throw" / "subject2.tsv"
PIECE = 20_000


class Auditor:
    """Checks set-points a piece at a time, over the joints between pieces too.

    Where delays are measured all are checked at the end: a check takes as long as several frames.
    """

    def __init__(self, robot, piece: float = PIECE) -> None:
        self.robot, self.held, self.n, self.piece = robot, [], 0, piece
        self.beyond = self.torque_beyond = self.speed_beyond = 0
        self.rows = 0
        spec, _ = arm_spec(robot, 1e-3)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)

    def take(self, points) -> None:
        self.held.append(points)
        self.rows += len(points.positions)
        if self.rows >= self.piece:
            self.check()

    def check(self) -> None:
        parts = [np.concatenate(one) for one in zip(*self.held, strict=True)]
        report = check_limits(self.robot, *parts)
        self.beyond += report.violations + report.jerk + report.self_collisions
        speed = np.abs(np.diff(parts[0], axis=0)) * 1000 / self.robot.limits.velocity
        self.speed_beyond += int((speed > 1 + 1e-6).any(axis=1).sum())
        for q, v, a in zip(*(part[::10] for part in parts), strict=True):
            self.data.qpos[:], self.data.qvel[:], self.data.qacc[:] = q, v, a
            mujoco.mj_inverse(self.model, self.data)
            share = np.abs(self.data.qfrc_inverse) / self.robot.limits.torque
            self.torque_beyond += int(share.max() > 1 + 1e-6)
        self.n += len(parts[0]) - (self.n > 0)
        self.held = [type(self.held[0])(*(part[-1:] for part in parts))]
        self.rows = 1


class Session:
    """The sample there and back for so long; now and then the hand is hidden, or jumps."""

    def __init__(self, minutes: float) -> None:
        recording = read_recording(SAMPLE)
        self.positions, self.rate_hz, self.names = (
            recording.positions, recording.rate_hz, recording.names,
        )  # fmt: skip
        self.n, self.row, self.ended = round(60 * minutes * self.rate_hz), 0, False
        rng = np.random.default_rng(0)
        faults = rng.integers(1000, max(self.n, 1001), round(2 * minutes))
        self.hidden = {int(row) + k for row in faults[::2] for k in range(rng.integers(1, 120))}
        self.jumped = {int(row) + k for row in faults[1::2] for k in range(rng.integers(1, 120))}
        self.hand = [k for k, name in enumerate(self.names) if name.startswith("Hand")]

    def open(self) -> StreamFormat:
        return StreamFormat("session", self.names, self.rate_hz)

    def start(self) -> None:
        pass

    def close(self) -> None:
        pass

    def read(self, timeout_s: float) -> Packet:
        row, self.row = self.row, self.row + 1
        self.ended = self.row == self.n
        last = len(self.positions) - 1
        at = row % (2 * last)
        frame = self.positions[min(at, 2 * last - at)]
        if row in self.hidden or row in self.jumped:
            frame = frame.copy()
            frame[self.hand] = np.nan if row in self.hidden else frame[self.hand] + [0.4, 0.3, 0.2]
        return Packet(row / self.rate_hz, frame, time.perf_counter(), row)


def over_loopback(plan) -> None:
    """Play in another process, mirror in this one."""
    command = [sys.executable, "-m", "besman", "play", str(SAMPLE), "--as", "qtm"]
    player = subprocess.Popen([*command, "--port", str(PORT)], stdout=subprocess.PIPE, text=True)
    player.stdout.readline()
    auditor = Auditor(plan.robot, piece=np.inf)
    twin = Mirror(QtmSource("127.0.0.1", PORT, wait_s=1.0), plan, take=auditor.take)
    twin.open()
    before_s = waited_s()
    for _ in twin.run():
        pass
    on_queue_s = waited_s() - before_s
    player.wait()
    auditor.check()
    found = twin.summary()
    print(f"{plan.robot.name}: {found['frames']} frames over loopback, {found['lost']} lost")
    for name, seconds in (
        ("packet to set-points, since it was received", twin.times[0]),
        ("the same, since it was due", twin.times[1]),
        ("computed of it", twin.times[2]),
    ):
        median, high = 1e3 * np.nanpercentile(seconds, (50, 99.9))
        print(f"{name}: {median:.2f} ms median, {high:.2f} ms 99.9 %")
    alone = 1e3 * np.percentile(queue_alone(twin.times[2], 0.01), (50, 99.9))
    print(
        f"by what is computed alone, frame after frame at 100 Hz: {alone[0]:.2f} ms median, "
        f"{alone[1]:.2f} ms 99.9 %; the thread waited {on_queue_s:.2f} s for a core"
    )
    tell(auditor)


def waited_s() -> float:
    """Return for how long this thread was ready to run while other programs had the cores."""
    return int(Path("/proc/thread-self/schedstat").read_text().split()[1]) * 1e-9


def queue_alone(computed_s, step_s: float) -> np.ndarray:
    """Return from arrival to end of each frame if nothing but computing took time."""
    behind_s, taken = 0.0, np.empty(len(computed_s))
    for row, cost_s in enumerate(computed_s):
        taken[row] = behind_s + cost_s
        behind_s = max(0.0, taken[row] - step_s)
    return taken


def tell(auditor: Auditor) -> None:
    print(
        f"{auditor.n} set-points: {auditor.beyond} beyond a limit or touching, "
        f"{auditor.speed_beyond} too fast by differences, {auditor.torque_beyond} of every tenth "
        "beyond a torque by MuJoCo"
    )


def soak(plan, minutes: float) -> None:
    auditor = Auditor(plan.robot)
    session = Session(minutes)
    twin = Mirror(session, plan, by_frames=True, take=auditor.take)
    twin.open()
    process, before, begun = psutil.Process(), float("nan"), time.process_time()
    for row, _ in enumerate(twin.run()):
        if row == 12_000:
            before = process.memory_info().rss
    spent_s = time.process_time() - begun
    auditor.check()
    grown = (process.memory_info().rss - before) / 1e6
    found = twin.summary()
    print(
        f"{minutes:g} min with {len(session.hidden)} frames hidden and {len(session.jumped)} "
        f"jumped: {found['withheld']} frames for which there was no plan, {grown:.1f} MB more "
        f"memory since two minutes, {found['frames'] / spent_s:.0f} frames a second of computing "
        "(with these checks)"
    )
    median, high = 1e3 * np.percentile(twin.times[2], (50, 99.9))
    print(f"computed of a frame: {median:.2f} ms median, {high:.2f} ms 99.9 %")
    tell(auditor)


def delay(robot_name: str, slower: int) -> None:
    """Say how far behind the arm is: that shift of its path which lies nearest to the hand's."""
    robot, recording = load_robot(robot_name), read_recording(SAMPLE)
    n = len(recording.time)
    at = np.arange((n - 1) * slower + 1) / slower
    low = np.minimum(at.astype(int), n - 2)
    share = (at - low)[:, None, None]
    positions = recording.positions[low] * (1 - share) + recording.positions[low + 1] * share
    source = FileSource(SAMPLE, 0.0)
    source.open()
    source._recording = replace(
        recording, time=np.arange(len(at)) / recording.rate_hz, positions=positions
    )
    source.open = lambda: StreamFormat("slower", recording.names, recording.rate_hz)
    twin = Mirror(source, MirrorPlan(robot, "right_arm"), learn_s=10.0 * slower, by_frames=True)
    twin.open()
    asked, reached = [], []
    for one in twin.run():
        if one["kind"] == "joints":
            asked.append(twin._twin.target[:3, 3])
            positions = np.array(one["positions_rad"])[None]
            reached.append(forward_kinematics(robot.chain, positions)[0, :3, 3])
    asked, reached = np.array(asked), np.array(reached)
    lags = np.arange(40)
    rms = [np.sqrt(np.mean(np.sum((reached[k:] - asked[: len(asked) - k]) ** 2, 1))) for k in lags]
    best = int(np.argmin(rms))
    away = np.linalg.norm(reached - asked, axis=1)
    print(
        f"{robot_name}, {slower} times slower: behind by {1e3 * best / recording.rate_hz:.0f} ms; "
        f"away {1e3 * np.median(away):.1f} mm median, {1e3 * np.percentile(away, 95):.0f} mm 95 %"
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("run", type=Path, nargs="?")
    parser.add_argument("--robot", default="ur5")
    parser.add_argument("--minutes", type=float, default=8.0)
    asked = parser.parse_args()
    if asked.run is None:
        plan = MirrorPlan(load_robot(asked.robot), "right_arm")
    else:
        plan = mirror_as_in_run(asked.run)
    over_loopback(plan)
    soak(plan, asked.minutes)
    for slower in (1, 3):
        delay(asked.robot, slower)


if __name__ == "__main__":
    main()
