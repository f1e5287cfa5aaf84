"""What commands cost on long recordings: time and peak memory at 10, 30 and 60 minutes.

    python benchmarks/long_recordings.py [--against CHECKOUT] [--minutes 10 30 60] [--rates 100 500]
        [--only segment label-markers annotate follow look run]

Recordings are *synthetic*: stick throws with 13 markers, played to and fro with fresh noise; those
for ``label-markers`` and ``annotate`` have no names and 2 % of their samples are missing. Each
command is a process of its own. Peak memory is the greatest of it and its workers'. ``annotate`` is
timed until its page, the curves and the proposals are there, then stopped. ``run`` is that of 697
throws, imitated only, once. *Grows* is what a further minute costs between the two longest lengths
over what it costs between the two shortest: 1 is linear. With another checkout each command is run
by both in turn; what takes longer than ``--longest`` seconds is cut.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from http.cookiejar import CookieJar
from pathlib import Path
from typing import Any, NamedTuple
from urllib.error import URLError

import numpy as np

from besman.evaluation.degradation import DegradeRecipe

ROOT = Path(__file__).resolve().parents[1]
TEACHER = "teacher.tsv"
STEPS = ("segment", "label-markers", "annotate", "follow", "look", "run")
FINGERS = {"thumb": (0.06, 0.05, -0.02), "index": (0.1, 0.02, 0.0), "middle": (0.1, -0.01, 0.0)}
NOISE_M = 0.0002
# Gaps that are filled, so that there are proposals.
SPOILT = DegradeRecipe(missing=0.02, gap_mean_s=0.1, gap_max_s=0.3)
THROWS = (
    "label={method: named, markers: right_arm}",
    "refine.robustness=null",
    "refine.episodes=1",
)


class Cost(NamedTuple):
    """Of one command: seconds, and MB at most; `note` says what became of it."""

    wall_s: float
    cpu_s: float
    peak_mb: float
    note: str = ""


class Place(NamedTuple):
    """What is measured on: recordings of one length, and where to write."""

    named: Path
    unnamed: Path
    folder: Path


def play(minutes: float, rate_hz: float, folder: Path, name: str, unnamed: bool) -> Path:
    """Write a recording; run in a process of its own, because arrays of an hour are large."""
    from besman.evaluation.degradation import degrade_recording
    from besman.io.recordings.formats import write_recording
    from besman.records import Recording
    from besman.synthetic.datasets import captures

    take = next(captures("stick_throw_marked", 1, 13, rate_hz=rate_hz, seed=1)).recording
    hand = take.positions[:, take.names.index("Hand top")]
    fingers = [hand + offset for offset in FINGERS.values()]
    box = np.broadcast_to([1.5, 0.5, 0.8], hand.shape)
    forth = np.concatenate([take.positions, np.stack([*fingers, box], axis=1)], axis=1)
    random = np.random.default_rng(0)
    n, pieces = round(60 * minutes * rate_hz), []
    while sum(map(len, pieces)) < n:
        piece = forth[:: -1 if len(pieces) % 2 else 1]
        piece = piece + random.normal(0.0, NOISE_M, piece.shape)
        if unnamed:
            piece = degrade_recording(piece, rate_hz, SPOILT, len(pieces)).positions
            # Which trajectory is in which column differs from piece to piece.
            piece[-1] = np.nan
        pieces.append(piece)
    width = max(piece.shape[1] for piece in pieces)
    positions = np.full((sum(map(len, pieces)), width, 3), np.nan)
    row = 0
    for piece in pieces:
        positions[row : row + len(piece), : piece.shape[1]] = piece
        row += len(piece)
    names = (None,) * width if unnamed else (*take.names, *FINGERS, "box_back")
    path = folder / name
    write_recording(Recording(np.arange(n) / rate_hz, positions[:n], names, rate_hz, name), path)
    return path


def write_teachers(folder: Path) -> None:
    """Write what is learnt from: a take with all names, and one with its segments."""
    from besman.synthetic.capture import write_capture
    from besman.synthetic.datasets import captures

    play(1, 100.0, folder, TEACHER, False)
    (folder / "labelled").mkdir()
    write_capture(next(captures("stick_throw_marked", 1, 13, seed=2)), folder / "labelled")


def apart(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function in a fresh process: a child's peak memory begins with its parent's."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


class Checkout:
    """A checkout whose commands are measured."""

    def __init__(self, root: Path, work: Path, longest_s: float) -> None:
        python = root / ".venv" / "bin" / "python"
        self._command = [str(python) if python.is_file() else sys.executable, "-m", "besman"]
        self._root, self._longest_s = root, longest_s
        self.work = work
        work.mkdir()

    def run(
        self, *arguments: str, follow: Callable[[subprocess.Popen[str]], str] | None = None
    ) -> Cost:
        """Run a command to its end, or until `follow`, which returns a note, has seen enough."""
        environment = {**os.environ, "PYTHONPATH": str(self._root), "NO_COLOR": "1"}
        start = time.perf_counter()
        with tempfile.TemporaryFile("w+") as said:
            process = subprocess.Popen(
                [*self._command, *arguments],
                stdout=subprocess.PIPE if follow else subprocess.DEVNULL,
                stderr=said,
                text=True,
                env=environment,
                cwd=self.work,
                start_new_session=True,
            )
            timer = threading.Timer(self._longest_s, os.killpg, (process.pid, signal.SIGKILL))
            timer.start()
            note = ""
            if follow is not None:
                note = follow(process)
                process.terminate()
            wall_s = time.perf_counter() - start
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            wall_s = wall_s if follow else time.perf_counter() - start
            timer.cancel()
            if process.returncode == -signal.SIGKILL:
                note = ", ".join(filter(None, [note, f"cut at {self._longest_s:g} s"]))
            elif process.returncode > 0 and follow is None:
                said.seek(0)
                sys.exit(f"besman {' '.join(arguments)}: {said.read()}")
        peak_mb = usage.ru_maxrss / 1024
        return Cost(wall_s, usage.ru_utime + usage.ru_stime, peak_mb, note)

    def measure(self, step: str, place: Place) -> Cost:
        """Measure a command."""
        learn = ("--learn-from", str(place.folder / TEACHER))
        if step in ("segment", "look"):
            return self.run(step, str(place.named))
        if step == "label-markers":
            out = self.work / "named.tsv"
            out.unlink(missing_ok=True)
            return self.run("label-markers", str(place.unnamed), "--out", str(out), *learn)
        if step == "annotate":
            command = ("annotate", str(place.unnamed), "--no-browser", *learn)
            return self.run(*command, follow=visit)
        if step == "follow":
            model = self.work / "model"
            if not model.with_suffix(".npz").is_file():
                self.run("train", str(place.folder / "labelled"), "--out", str(model))
            return self.run("follow", str(place.named), "--model", str(model))
        settings = [part for one in THROWS for part in ("--set", one)]
        recordings = f"recordings={place.folder / 'throws'}"
        return self.run("run", "ur5_stick_throw", "--out", "run", "--set", recordings, *settings)


def visit(process: subprocess.Popen[str]) -> str:
    """Load what the annotation page loads; say when it was there."""
    start, times = time.perf_counter(), []
    address = next((found[0] for line in process.stdout or () if (found := _address(line))), None)
    if address is None:
        return "no page"
    times.append(f"page {time.perf_counter() - start:.1f} s")
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))
    try:
        with opener.open(address) as page:
            place = page.url
        about = json.load(opener.open(f"{place}recording?recording=0"))
        top = about["n_levels"] - 1
        for route in ("sketch?", f"chunk?group=speeds&marker=0&level={top}&index=0&"):
            opener.open(f"{place}{route}recording=0").read()
        times.append(f"curves {time.perf_counter() - start:.1f} s")
        found = json.load(opener.open(f"{place}stretches?recording=0&layer="))
        what = f"{len(found['stretches'])} proposals" if found["stretches"] else found["note"]
        times.append(f"{what} {time.perf_counter() - start:.1f} s")
    except (URLError, ConnectionError) as error:
        times.append(f"then {error}")
    return ", ".join(times)


def _address(line: str) -> re.Match[str] | None:
    return re.search(r"http://\S+", line)


def describe(step: str, costs: list[Cost]) -> str:
    """Return a row of a table: of this checkout, and beside it the other."""
    cells = []
    for cost in costs:
        cells.append(f"{cost.wall_s:7.1f} s {cost.cpu_s:7.1f} s {cost.peak_mb:6.0f} MB")
    if len(costs) == 2:
        other, mine = costs
        cells.append(f"CPU x {mine.cpu_s / other.cpu_s:.2f}")
        cells.append(f"memory x {mine.peak_mb / other.peak_mb:.2f}")
    notes = "; ".join(cost.note for cost in costs if cost.note)
    return f"  {step:>14}  {'  |  '.join(cells)}{f'  ({notes})' if notes else ''}"


def growth(minutes: list[float], cpu_s: list[float]) -> float:
    """Return what a further minute costs at the end over what it costs at the beginning."""
    slopes = np.diff(cpu_s) / np.diff(minutes)
    return float(slopes[-1] / slopes[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, metavar="CHECKOUT")
    parser.add_argument("--minutes", type=float, nargs="+", default=[10, 30, 60])
    parser.add_argument("--rates", type=float, nargs="+", default=[100, 500])
    parser.add_argument("--only", nargs="+", choices=STEPS, default=list(STEPS))
    parser.add_argument("--longest", type=float, default=180.0, help="seconds of a command")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        others = [] if chosen.against is None else [chosen.against.resolve()]
        checkouts = [
            Checkout(root, folder / f"work{k}", chosen.longest)
            for k, root in enumerate([*others, ROOT])
        ]
        print("wall, CPU and peak memory" + (", the other checkout first" if others else ""))
        apart(write_teachers, folder)
        for rate_hz in chosen.rates:
            measure_rate(rate_hz, chosen, checkouts, folder)
        if "run" in chosen.only:
            subprocess.run(
                [sys.executable, "-m", "besman", "synth", "stick_throw", "--out", "throws"],
                cwd=folder,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                stdout=subprocess.DEVNULL,
                check=True,
            )
            place = Place(folder, folder, folder)
            print("697 throws, imitated only")
            print(describe("run", [one.measure("run", place) for one in checkouts]), flush=True)


def measure_rate(
    rate_hz: float, chosen: argparse.Namespace, checkouts: list[Checkout], folder: Path
) -> None:
    """Print the rows of all lengths at one rate."""
    steps = [step for step in STEPS if step in chosen.only and step != "run"]
    spent: dict[str, list[Cost]] = {step: [] for step in steps}
    if not steps:
        return
    for minutes in chosen.minutes:
        print(f"{minutes:g} min at {rate_hz:g} Hz", flush=True)
        needed = {"named": {"segment", "follow", "look"}, "unnamed": {"label-markers", "annotate"}}
        paths = {
            kind: apart(play, minutes, rate_hz, folder, f"{kind}.tsv", kind == "unnamed")
            if users & set(steps)
            else folder
            for kind, users in needed.items()
        }
        place = Place(paths["named"], paths["unnamed"], folder)
        for step in steps:
            costs = [checkout.measure(step, place) for checkout in checkouts]
            spent[step].append(costs[-1])
            print(describe(step, costs), flush=True)
    print(f"\n{table(rate_hz, chosen.minutes, spent)}\n", flush=True)


def table(rate_hz: float, minutes: list[float], spent: dict[str, list[Cost]]) -> str:
    """Return CPU seconds and peak memory of this checkout, as a table in Markdown."""
    heads = [f"{rate_hz:g} Hz", *(f"{one:g} min" for one in minutes), "grows"]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for step, costs in spent.items():
        cells = [f"{one.cpu_s:.1f} s, {one.peak_mb:.0f} MB" for one in costs]
        cpu_s = [one.cpu_s for one in costs]
        grows = f"{growth(minutes, cpu_s):.2f}" if len(minutes) > 2 else ""
        lines.append(f"| {' | '.join([f'`{step}`', *cells, grows])} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
