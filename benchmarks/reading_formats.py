"""How long an hour of 13 markers at 100 Hz takes to be read: each format beside pandas.

    python benchmarks/reading_formats.py [--minutes M] [--rounds N]

Files are written by the tests' own writers. pandas reads the numbers below the header
(`read_csv`, its C engine) and turns them into an array (T, M, 3) in metres: nothing is checked, no
gap is looked for. Turn by turn in one process that has both libraries loaded, and besman's kernel,
CPU seconds, the best of all; *fresh* is a process of its own each, imports and first read. Memory
is the highest that a reading took, as `tracemalloc` counts it, in bytes a cell of the file. *Bar*:
a tenth of pandas' time, or that of our TSV; where neither is met it says how many times TSV's.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
import tracemalloc
import warnings
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

N_MARKERS = 13
RATE_HZ = 100.0


def make_take(minutes):
    """Return a walk of points, with gaps in one of a hundred samples."""
    from besman.records import Recording

    random = np.random.default_rng(0)
    n_samples = round(60 * minutes * RATE_HZ)
    time_s = np.arange(n_samples) / RATE_HZ
    places = random.normal([0.0, 0.0, 1.0], 0.4, size=(1, N_MARKERS, 3))
    sway = 0.2 * np.sin(time_s[:, None, None] * random.uniform(0.5, 3.0, (1, N_MARKERS, 3)))
    positions = places + sway
    for start in range(0, n_samples - 20, 1000):
        positions[start : start + 10, start // 1000 % N_MARKERS] = np.nan
    names = tuple(f"m{k}" for k in range(N_MARKERS))
    return Recording(time_s, positions, names, RATE_HZ, "a", 1)


def write_files(take, folder):
    """Write one file of each format; return what pandas must know of it."""
    from foreign_recordings import motive_lines, nexus_lines, trc_lines, write_lines

    from besman.io.recordings.formats import write_recording

    write_recording(take, folder / "a.tsv")
    # All to a micrometre.
    write_lines(trc_lines(take, digits=3), folder / "a.trc")
    write_lines(motive_lines(take, digits=6), folder / "motive.csv")
    write_lines(nexus_lines(take, digits=3), folder / "nexus.csv")
    return {"a.tsv": (10, "\t", 2, 1e-3), "a.trc": (6, "\t", 2, 1e-3),
            "motive.csv": (7, ",", 2, 1.0), "nexus.csv": (5, ",", 2, 1e-3)}  # fmt: skip


def read_by_pandas(path, skipped, separator, first, scale):
    import pandas

    table = pandas.read_csv(path, sep=separator, skiprows=skipped, header=None)
    values = table.iloc[:, first : first + 3 * N_MARKERS].to_numpy(dtype=float)
    return values.reshape(len(values), N_MARKERS, 3) * scale


def best_of(rounds, *tries):
    """Return the least CPU seconds of each try, turn by turn."""
    least = [float("inf")] * len(tries)
    for _ in range(rounds):
        for which, one in enumerate(tries):
            began = time.process_time()
            one()
            least[which] = min(least[which], time.process_time() - began)
    return least


def fresh_s(code, rounds):
    """Return the least CPU seconds of a fresh process that runs some code."""
    least = float("inf")
    for _ in range(rounds):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        subprocess.run([sys.executable, "-W", "ignore", "-c", code], check=True, env=environment)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        least = min(least, spent)
    return least


def measure_memory(read, n_cells):
    tracemalloc.start()
    read()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak / n_cells


def tell_bar(mine, pandas_s, tsv_s):
    """Say which of the two bars a format meets; times that differ by a twentieth are the same."""
    if mine <= 0.1 * pandas_s:
        return "a tenth of pandas"
    return "as TSV" if mine <= 1.05 * tsv_s else f"missed: {mine / tsv_s:.2f} of TSV"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    import besman.io.recordings.number_kernel  # noqa: F401
    from besman.io.recordings.formats import read_recording

    take = make_take(given.minutes)
    n_cells = take.positions.size
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print(
            f"{'file':12} {'MB':>6} {'besman':>9} {'pandas':>9} {'ratio':>6} {'to TSV':>6} "
            f"{'B/cell':>7} {'fresh':>9} {'pandas':>9}  bar"
        )
        tsv_s = None
        for file, how in write_files(take, folder).items():
            path = folder / file
            mine, pandas_s = best_of(
                given.rounds, lambda p=path: read_recording(p, up="z"),
                lambda p=path, h=how: read_by_pandas(p, *h),
            )  # fmt: skip
            tsv_s = tsv_s or mine
            memory = measure_memory(lambda p=path: read_recording(p, up="z"), n_cells)
            print(
                f"{file:12} {path.stat().st_size / 1e6:6.0f} {mine:7.2f} s {pandas_s:7.2f} s "
                f"{mine / pandas_s:6.2f} {mine / tsv_s:6.2f} {memory:7.0f}",
                end="",
            )
            own = "from besman.io.recordings.formats import read_recording as r; r(p, up='z')"
            other = (
                f"import pandas; pandas.read_csv(p, sep={how[1]!r}, skiprows={how[0]}, header=None)"
            )
            place = f"from pathlib import Path; p = Path({str(path)!r}); "
            times = [fresh_s(place + code, given.rounds) for code in (own, other)]
            print(
                f" {times[0]:7.2f} s {times[1]:7.2f} s  {tell_bar(mine, pandas_s, tsv_s)}",
                flush=True,
            )


if __name__ == "__main__":
    main()
