"""Live streams: how long from a packet to the label of its block, and what a bad network costs.

``besman play`` serves a recording over loopback from a process of its own, spoken to by the maker's
client; this process follows it. The time is that from when a frame was due in the player until all
that follows from it was taken: transport, waiting and label. Synthetic: the embedded sample, with
copies of its markers up to 13. And a finished run as MCAP: size, and time to write.

The same through an MCAP file that is being written, and with a source that is started again.

With --names: how much of recordings whose names were taken away is named right while they come.
With --rates: 13 markers at 500 Hz and 60 at 240 Hz from the socket, for so many seconds each.

    python benchmarks/live.py [RUN] [--seconds 60] [--soak SECONDS]
    python benchmarks/live.py [RUN] --rates SECONDS [--hz 500|240]
    python benchmarks/live.py --names FOLDER

RUN is a finished run of ``besman run``, whose model is followed; ``ur5_stick_throw`` is run if
there is none. The soak is simulated: as many seconds of frames as are said, as fast as can be.
"""

from __future__ import annotations

import argparse
import dataclasses
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import psutil

from besman.config.resources import find_resource, resource_folder
from besman.evaluation.degradation import GHOST, Degraded, DegradeRecipe, degrade_recording
from besman.evaluation.takes import make_protocols
from besman.following.live import LiveFollower
from besman.following.plans import make_plan
from besman.following.stream_names import LOOK_BACK_S
from besman.geometry.gaps import find_runs
from besman.io.recordings.formats import read_recording, write_recording
from besman.io.ros_logs import write_mcap
from besman.live.bag_source import BagSource
from besman.live.qtm_source import QtmSource
from besman.live.stream import Packet, StreamFormat
from besman.person.marker_set import load_marker_set
from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.pipeline.run_log import read_log
from besman.pipeline.stored_run import open_run
from besman.stages.label.online import OnlineNaming

N_MARKERS, RATE_HZ, PORT = 13, 100.0, 22299
MARGIN_S = 0.1
RECIPE = find_resource("pipelines", "ur5_stick_throw")
SAMPLE = resource_folder("data") / "stick_throw" / "subject1.tsv"


def make_recording(
    folder: Path, seconds: float, n_markers: int = N_MARKERS, rate_hz: float = RATE_HZ
) -> Path:
    """Write the sample with markers added, as often as it takes, at a rate."""
    sample = read_recording(SAMPLE)
    n, last = round(seconds * rate_hz), len(sample.time) - 1
    at = np.arange(n) * sample.rate_hz / rate_hz % (2 * last)
    # There and back, so that nobody jumps.
    at = np.minimum(at, 2 * last - at)
    low, share = np.minimum(at.astype(int), last - 1), (at % 1)[:, None, None]
    positions = (1 - share) * sample.positions[low] + share * sample.positions[low + 1]
    names = list(sample.names)
    while len(names) < n_markers:
        k = len(names)
        positions = np.concatenate([positions, positions[:, k % 9 : k % 9 + 1] + 0.05], axis=1)
        names.append(f"extra {k}")
    made = dataclasses.replace(
        sample,
        time=np.arange(n) / rate_hz,
        positions=positions,
        names=tuple(names),
        rate_hz=rate_hz,
    )
    path = folder / f"stream_{n_markers}.tsv"
    write_recording(made, path)
    return path


def play(path: Path, system: str, *options: str) -> subprocess.Popen:
    """Play in another process; return when it has begun to listen, or to write."""
    command = [sys.executable, "-m", "besman", "play", str(path), "--as", system, *options]
    player = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    player.stdout.readline()
    return player


def follow(path: Path, plan, *options: str):
    """Play in another process, follow in this one."""
    player = play(path, "qtm", "--port", str(PORT), *options)
    return run_through(QtmSource("127.0.0.1", PORT, wait_s=1.0), plan, player)


def follow_bag(path: Path, plan):
    """Follow the markers of an MCAP file that another process writes."""
    growing = path.with_suffix(".mcap")
    player = play(path, "mcap", "--out", str(growing))
    return run_through(BagSource(growing, from_start=True, wait_s=3.0), plan, player)


def run_through(source, plan, player: subprocess.Popen):
    follower = LiveFollower(source, plan)
    follower.open()
    for _ in follower.run():
        pass
    player.wait()
    return follower


def restart(path: Path, plan, clean: LiveFollower) -> None:
    """End the player while the person rests, and start it again with what is left a second on."""
    recording = read_recording(path)
    starts, ends = (
        np.array([getattr(one, key) for one in next(iter(clean.follower.state.blocks.values()))])
        for key in ("start", "end")
    )
    # The longest block in the middle is a rest.
    inner = np.flatnonzero((starts > 0.3 * ends[-1]) & (ends < 0.7 * ends[-1]))
    longest = inner[np.argmax((ends - starts)[inner])]
    row = round((starts[longest] + ends[longest]) / 2)
    parts = []
    for k, rows in enumerate((slice(None, row), slice(row, None))):
        part = dataclasses.replace(
            recording,
            time=recording.time[rows] - recording.time[rows][0],
            positions=recording.positions[rows],
        )
        parts.append(path.with_name(f"part_{k}.tsv"))
        write_recording(part, parts[-1])
    players = [play(parts[0], "qtm", "--port", str(PORT))]
    follower = LiveFollower(QtmSource("127.0.0.1", PORT, wait_s=10.0), plan)
    follower.open()
    again = threading.Thread(
        target=lambda: (
            players[0].wait() or players.append(play(parts[1], "qtm", "--port", str(PORT)))
        )
    )
    again.start()
    for _ in follower.run():
        pass
    again.join()
    # Nobody knows how long it was away but this machine's clock: by so much all is later.
    away = follower.summary()["frames"] - len(recording.time)
    truth = borders(clean)
    truth = np.where(truth > row, truth + away, truth)
    print(
        f"source ended at a rest and started again, {away / RATE_HZ:.2f} s away: F1 of borders "
        f"against those without {f1(borders(follower), truth):.4f}; {follower.summary()}"
    )
    for player in players:
        player.wait()


def rates(plan, folder: Path, seconds: float, only_hz: float | None) -> None:
    """Say what is lost of many frames from the socket, and what they leave in memory."""
    process = psutil.Process()
    for n_markers, rate_hz in ((13, 500.0), (60, 240.0)):
        if only_hz not in (None, rate_hz):
            continue
        # Of its own, so that both may be measured at once.
        port = PORT + round(rate_hz)
        path = make_recording(folder, seconds, n_markers, rate_hz)
        player = play(path, "qtm", "--port", str(port))
        follower = LiveFollower(QtmSource("127.0.0.1", port, wait_s=10.0), plan)
        follower.open()
        settled, before = min(30.0, seconds / 3) * rate_hz, 0
        for _ in follower.run():
            if not before and follower.look().time_s * rate_hz >= settled:
                before = process.memory_info().rss
        player.wait()
        grown = (process.memory_info().rss - before) / 1e6
        found = follower.summary()
        print(
            f"{n_markers} markers at {rate_hz:g} Hz from the socket, {seconds:g} s: "
            f"{found['frames']} frames of {round(seconds * rate_hz)}, {found['lost']} lost, "
            f"{grown:.1f} MB more memory since {settled / rate_hz:.0f} s"
        )
        tell_times(follower, "packet to label")


def tell_times(follower: LiveFollower, what: str) -> None:
    for name, seconds in zip(
        ("since it was received", "since it was due", "computed of it"), follower.times, strict=True
    ):
        median, high = 1e3 * np.nanpercentile(seconds, (50, 99.9))
        print(f"{what}, {name}: {median:.2f} ms median, {high:.2f} ms 99.9 %")


def borders(follower: LiveFollower) -> np.ndarray:
    pieces = next(iter(follower.follower.state.blocks.values()))
    return np.array([one.start for one in pieces[1:]])


def f1(found: np.ndarray, truth: np.ndarray) -> float:
    near = np.abs(found[:, None] - truth) <= MARGIN_S * RATE_HZ
    return 2 * near.any(axis=1).sum() / (len(found) + len(truth))


class Flood:
    """Frames of the sample, resampled, as fast as they are taken."""

    def __init__(self, n_markers: int, rate_hz: float, seconds: float) -> None:
        sample = read_recording(SAMPLE)
        more = np.arange(n_markers - len(sample.names)) % len(sample.names)
        extra = sample.positions[:, more] + 0.05
        self.positions = np.concatenate([sample.positions, extra], axis=1)
        self.sample_hz, self.last_s = sample.rate_hz, sample.time[-1] - sample.time[0]
        names = (*sample.names, *(f"extra {k}" for k in range(len(more))))
        self.format, self.row, self.ended = StreamFormat("flood", names, rate_hz), 0, False
        self.n = round(seconds * rate_hz)

    def open(self) -> StreamFormat:
        return self.format

    def start(self) -> None:
        pass

    def close(self) -> None:
        pass

    def read(self, timeout_s: float) -> Packet:
        row, self.row = self.row, self.row + 1
        self.ended = self.row == self.n
        at_s = row / self.format.rate_hz
        there_and_back = at_s % (2 * self.last_s)
        place = min(there_and_back, 2 * self.last_s - there_and_back)
        frame = self.positions[min(round(place * self.sample_hz), len(self.positions) - 1)]
        return Packet(at_s, frame, time.perf_counter(), row)


def exchange(positions: np.ndarray, rate_hz: float) -> tuple[Degraded, np.ndarray]:
    """Exchange two points of a frame, and of all behind it, once a second; return the order too."""
    random, n = np.random.default_rng(0), positions.shape[1]
    orders = np.tile(np.arange(n), (len(positions), 1))
    for row in range(round(rate_hz / 2), len(positions), round(rate_hz)):
        one, two = random.choice(n, 2, replace=False)
        orders[row:, [one, two]] = orders[row:, [two, one]]
    truth = np.where(np.isfinite(positions[:, :, 0]), np.arange(n), GHOST)
    mixed = np.take_along_axis(positions, orders[:, :, None], axis=1)
    return Degraded(mixed, np.take_along_axis(truth, orders, axis=1)), orders


def degrade(positions: np.ndarray, rate_hz: float, recipe: DegradeRecipe):
    """Break trajectories; they keep their columns."""
    spoilt = degrade_recording(positions, rate_hz, recipe, 0)
    n = spoilt.truth.shape[1]
    return spoilt, np.tile(np.arange(n), (len(positions), 1))


def name_live(naming: OnlineNaming, positions: np.ndarray):
    """Return the names of each frame as it came, when they began, and the time of the thread."""
    said = np.full(positions.shape[:2], GHOST)
    begun, seconds = len(positions), np.zeros(len(positions))
    for row, frame in enumerate(positions):
        start = time.thread_time()
        naming.take(frame)
        seconds[row] = time.thread_time() - start
        if naming.has_begun:
            begun = min(begun, row)
            said[row] = naming.names
    return said, begun, seconds[begun:]


def look_back(said: np.ndarray, seen: np.ndarray, rows: int) -> np.ndarray:
    """Return the names as they were so many frames later, or when their trajectory ended."""
    later = said.copy()
    for column in range(said.shape[1]):
        for start, stop in find_runs(seen[:, column]):
            at = np.minimum(np.arange(start, stop) + rows, stop - 1)
            later[start:stop, column] = said[at, column]
    return later


def names(folder: Path) -> None:
    """Say how much is named right and wrong, at once and after half a second."""
    marker_set = load_marker_set("right_arm")
    ways = {
        "as recorded": lambda *take: degrade(*take, DegradeRecipe(0.0)),
        "two exchanged a second": exchange,
        "2 % hidden": lambda *take: degrade(*take, DegradeRecipe(0.02)),
        "5 % hidden, 0.5 ghosts": lambda *take: degrade(*take, DegradeRecipe(0.05, 0.5)),
    }
    for protocol in make_protocols(folder):
        places = marker_set.find(protocol.model.markers, protocol.dataset)
        required = np.array([places[name] for name in marker_set.required])
        for way, spoil in ways.items():
            counts, waits, costs = np.zeros((2, 2)), [], []
            for take in protocol.takes:
                spoilt, orders = spoil(take.positions, take.rate_hz)
                n = spoilt.truth.shape[1]
                naming = OnlineNaming(protocol.model, required, n, take.rate_hz)
                said, begun, seconds = name_live(naming, spoilt.positions)
                # Of each trajectory, wherever its points came.
                own = np.argsort(orders, axis=1)
                seen = np.isfinite(spoilt.positions[:, :, 0])
                kept = (np.take_along_axis(one, own, axis=1) for one in (said, seen))
                later = look_back(*kept, round(LOOK_BACK_S * take.rate_hz))
                later = np.take_along_axis(later, orders, axis=1)
                truth, n_true = spoilt.truth[begun:], (spoilt.truth[begun:] != GHOST).sum()
                for k, given in enumerate((said[begun:], later[begun:])):
                    named = given != GHOST
                    right = (given == truth) & named
                    counts[k] += right.sum() / n_true, (named & ~right).sum() / n_true
                waits.append(begun / take.rate_hz)
                costs.append(seconds)
            (right, wrong), (right_later, wrong_later) = 100 * counts / len(protocol.takes)
            median, high = 1e3 * np.percentile(np.concatenate(costs), (50, 99.9))
            print(
                f"{len(protocol.takes)} of {protocol.takes[0].person}, model of the "
                f"{protocol.learnt_from}, {way}: right {right:.2f} wrong {wrong:.3f} % at once, "
                f"{right_later:.2f} and {wrong_later:.3f} % after {LOOK_BACK_S:g} s; begun after "
                f"{np.median(waits):.2f} s ({max(waits):.2f} at most); {median:.2f} ms a frame, "
                f"{high:.1f} ms 99.9 % (thread)"
            )


def flood(plan, n_markers: int, rate_hz: float, seconds: float) -> None:
    """Say how many frames a second of computing takes, and what it leaves in memory."""
    follower = LiveFollower(Flood(n_markers, rate_hz, seconds), plan)
    follower.open()
    process, begun = psutil.Process(), time.process_time()
    before = 0
    for _ in follower.run():
        settled = follower.summary()["frames"] >= min(30.0, seconds / 2) * rate_hz
        before = before or settled * process.memory_info().rss
    spent_s, found = time.process_time() - begun, follower.summary()
    grown = (process.memory_info().rss - before) / 1e6
    print(
        f"{n_markers} markers at {rate_hz:g} Hz, {seconds:g} s: {found['frames'] / spent_s:.0f} "
        f"frames a second of computing, {found['lost']} lost, {grown:.1f} MB more memory"
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("run", type=Path, nargs="?")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--soak", type=float, help="so many seconds of frames, and nothing else")
    parser.add_argument(
        "--hz", type=float, choices=(500.0, 240.0), help="with --rates: one of them"
    )
    parser.add_argument("--rates", type=float, help="so many seconds each, and nothing else")
    parser.add_argument("--names", type=Path, help="name the recordings of it, and nothing else")
    asked = parser.parse_args()
    if asked.names:
        names(asked.names)
        return
    with tempfile.TemporaryDirectory() as folder:
        run = asked.run or run_pipeline(load_pipeline(RECIPE), Path(folder) / "run", jobs=2)
        plan = make_plan(run, [])
        if asked.soak:
            flood(plan, 13, 500.0, asked.soak)
            flood(plan, 60, 240.0, asked.soak)
            return
        if asked.rates:
            rates(plan, Path(folder), asked.rates, asked.hz)
            return
        path = make_recording(Path(folder), asked.seconds)
        clean = follow(path, plan)
        found = clean.summary()
        tell_times(clean, "packet to label")
        print(
            f"{found['frames']} frames of {N_MARKERS} markers at {RATE_HZ:g} Hz, "
            f"{found['lost']} lost"
        )
        bad = follow(path, plan, "--lose", "0.01", "--late", "0.05", "--seed", "3")
        print(
            f"1 % lost, late by 50 ms: F1 of borders against those without "
            f"{f1(borders(bad), borders(clean)):.4f}; {bad.summary()}"
        )
        restart(path, plan, clean)
        bag = follow_bag(path, plan)
        tell_times(bag, "MCAP being written to label")
        print(
            f"MCAP being written: F1 of borders against those by QTM's protocol "
            f"{f1(borders(bag), borders(clean)):.4f}; {bag.summary()}"
        )
        # The sample alone: copies of markers beside them would be none of a person.
        named, unnamed = follow(SAMPLE, plan), follow(SAMPLE, plan, "--unnamed")
        tell_times(unnamed, "unnamed packet to label")
        print(
            f"unnamed, {len(read_recording(SAMPLE).names)} markers: F1 of borders against those of "
            f"the named {f1(borders(unnamed), borders(named)):.4f}; {unnamed.summary()}"
        )
        flood(plan, 13, 500.0, 120.0)
        flood(plan, 60, 240.0, 120.0)
        log = read_log(open_run(run))
        target = Path(folder) / "run.mcap"
        times = []
        for _ in range(3):
            begun = time.perf_counter()
            write_mcap(log, target)
            times.append(time.perf_counter() - begun)
        print(f"MCAP: {target.stat().st_size / 1e6:.2f} MB, {np.median(times):.2f} s")


if __name__ == "__main__":
    main()
