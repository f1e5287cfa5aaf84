"""Live streams: how long from a packet to the label of its block, and what a bad network costs.

``besman play`` serves a recording over loopback from a process of its own, spoken to by the maker's
client; this process follows it. The time is that from when a frame was due in the player until all
that follows from it was taken: transport, waiting and label. Synthetic: the embedded sample, with
copies of its markers up to 13. And a finished run as MCAP: size, and time to write.

    python benchmarks/live.py RUN [--seconds 60]

RUN is a finished run of ``besman run``, whose model is followed.
"""

from __future__ import annotations

import argparse
import dataclasses
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from besman.config.resources import resource_folder
from besman.following.live import LiveFollower
from besman.following.plans import make_plan
from besman.io.recordings.formats import read_recording, write_recording
from besman.io.ros_logs import write_mcap
from besman.live.qtm_source import QtmSource
from besman.pipeline.run_log import read_log
from besman.pipeline.stored_run import open_run

N_MARKERS, RATE_HZ, PORT = 13, 100.0, 22299
MARGIN_S = 0.1


def make_recording(folder: Path, seconds: float) -> Path:
    """Write the sample with markers added up to 13, as often as it takes."""
    sample = read_recording(resource_folder("data") / "stick_throw" / "subject1.tsv")
    n = round(seconds * RATE_HZ)
    rows = np.arange(n) % len(sample.time)
    # There and back, so that nobody jumps.
    rows = np.where((np.arange(n) // len(sample.time)) % 2 == 0, rows, len(sample.time) - 1 - rows)
    positions = sample.positions[rows]
    names = list(sample.names)
    while len(names) < N_MARKERS:
        k = len(names)
        positions = np.concatenate([positions, positions[:, k % 9 : k % 9 + 1] + 0.05], axis=1)
        names.append(f"extra {k}")
    made = dataclasses.replace(
        sample, time=np.arange(n) / RATE_HZ, positions=positions, names=tuple(names)
    )
    path = folder / "stream.tsv"
    write_recording(made, path)
    return path


def follow(path: Path, plan, *options: str):
    """Play in another process, follow in this one."""
    command = [sys.executable, "-m", "besman", "play", str(path), "--as", "qtm"]
    player = subprocess.Popen(
        [*command, "--port", str(PORT), *options], stdout=subprocess.PIPE, text=True
    )
    player.stdout.readline()
    follower = LiveFollower(QtmSource("127.0.0.1", PORT, wait_s=1.0), plan)
    follower.open()
    for _ in follower.run():
        pass
    player.wait()
    return follower


def borders(follower: LiveFollower) -> np.ndarray:
    pieces = next(iter(follower.follower.state.blocks.values()))
    return np.array([one.start for one in pieces[1:]])


def f1(found: np.ndarray, truth: np.ndarray) -> float:
    near = np.abs(found[:, None] - truth) <= MARGIN_S * RATE_HZ
    return 2 * near.any(axis=1).sum() / (len(found) + len(truth))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("run", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0)
    asked = parser.parse_args()
    plan = make_plan(asked.run, [])
    with tempfile.TemporaryDirectory() as folder:
        path = make_recording(Path(folder), asked.seconds)
        clean = follow(path, plan)
        found = clean.summary()
        for name, seconds in (
            ("since it was received", clean.seconds),
            ("since it was due", clean.since_sent),
            ("computed of it", clean.busy),
        ):
            median, high = 1e3 * np.nanpercentile(seconds, (50, 99.9))
            print(f"packet to label, {name}: {median:.2f} ms median, {high:.2f} ms 99.9 %")
        print(
            f"{found['frames']} frames of {N_MARKERS} markers at {RATE_HZ:g} Hz, "
            f"{found['lost']} lost"
        )
        bad = follow(path, plan, "--lose", "0.01", "--late", "0.05", "--seed", "3")
        print(
            f"1 % lost, late by 50 ms: F1 of borders against those without "
            f"{f1(borders(bad), borders(clean)):.4f}; {bad.summary()}"
        )
        log = read_log(open_run(asked.run))
        target = Path(folder) / "run.mcap"
        times = []
        for _ in range(3):
            begun = time.perf_counter()
            write_mcap(log, target)
            times.append(time.perf_counter() - begun)
        print(f"MCAP: {target.stat().st_size / 1e6:.2f} MB, {np.median(times):.2f} s")


if __name__ == "__main__":
    main()
