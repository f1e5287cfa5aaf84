"""The study of embodiment mapping: 697 simulated throws and real recordings, each to four arms.

    python benchmarks/mapping.py [FOLDER OF RECORDINGS] [--subjects N] [--repetitions N] [--jobs N]
                                 [--robot NAME ...] [--figures DIR] [--json FILE]

Prints the tables of ``besman evaluate mapping``, then every bar of the study beside what was
measured. Seconds are of mapping, inverse kinematics and limits together, by the clock.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np
from rich.console import Console

from besman.evaluation.mapping import ROBOTS, evaluate_mapping
from besman.evaluation.mapping_data import load_demonstrations, simulate_throw_set
from besman.evaluation.mapping_figures import write_mapping_figures
from besman.evaluation.mapping_tables import mapping_tables, reason_lines
from besman.io.atomic_files import write_json
from besman.work.work import Work
from besman.work.workers import Workers

ROOT = Path(__file__).resolve().parents[1]
REAL = Path(os.environ.get("BESMAN_REAL_DATA", ROOT.parent / "shared" / "data")) / "pick_and_place"
# Of 697 throws to be transferred; 95th percentile of the position error, cm; seconds for 100.
BARS = {"ur5": (690, 3, 60), "ur10": (697, 1, 60), "iiwa7": (697, 1, 100), "compi": (690, 3, 100)}


def show(what: str, got: str, bar: str = "") -> None:
    print(f"{what:64}{got:>18}{bar:>14}")


def study(sets: list, options: argparse.Namespace) -> tuple[dict, list]:
    with Workers(options.jobs) as workers:
        result, mapped = evaluate_mapping(
            sets, options.robot or ROBOTS, work=Work(options.jobs, workers=workers)
        )
    console = Console(width=110)
    for table in mapping_tables(result["rows"]):
        console.print(table)
    for line in reason_lines(result["rows"]):
        print(line)
    return result, mapped


def show_throws(rows: list, wall_s: float, n: int) -> None:
    for row in rows:
        transferred, p95_cm, seconds = BARS.get(row["robot"], ("", "", ""))
        robot, error = row["robot"], row["position_error_m"]
        show(f"{robot}: transferred", f"{row['n_transferred']} of {n}", f"{transferred} of 697")
        p95 = "-" if error is None else f"{100 * error['p95']:.3f}"
        show("  position error, 95th percentile [cm]", p95, str(p95_cm))
        show(
            "  samples at 1 kHz outside a limit / in self-collision",
            f"{row['limit_violations']} / {row['self_collisions']}",
            "0 / 0",
        )
        show(
            "  100 demonstrations [s]",
            f"{100 * row['seconds_per_demonstration']:.1f}",
            str(seconds),
        )
        cpu = 100 * row["cpu_seconds_per_demonstration"]
        show("  100 demonstrations, CPU of all processes [s]", f"{cpu:.1f}")
    to_all = rows[0]["n_transferred_to_all"]
    show("transferred to all robots (thesis, real: 682 of 697)", f"{to_all} of {n}")
    show("the whole study of throws, simulation included [min]", f"{wall_s / 60:.1f}", "30")
    peak = max(row["peak_rss_mb"] for row in rows)
    show("greatest memory of a process [MB]", f"{peak:.0f}", "1000")


def show_real(rows: list) -> None:
    shares = np.array([[row["n_transferred"], row["n_demonstrations"]] for row in rows])
    moved, n = shares.sum(axis=0)
    n_classes = len({row["label"] for row in rows})
    n_robots = len({row["robot"] for row in rows})
    show(
        f"real: segments mapped, {n_classes} classes x {n_robots} robots",
        f"{moved} of {n}, {100 * moved / n:.1f} %",
        "99 %",
    )
    violations = sum(row["limit_violations"] for row in rows)
    collisions = sum(row["self_collisions"] for row in rows)
    show(
        "  samples at 1 kHz outside a limit / in self-collision",
        f"{violations} / {collisions}",
        "0 / 0",
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path, nargs="?", default=REAL)
    parser.add_argument("--subjects", type=int)
    parser.add_argument("--repetitions", type=int)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--robot", action="append")
    parser.add_argument("--figures", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    started = time.perf_counter()
    throws = simulate_throw_set(options.subjects, options.repetitions)
    result, mapped = study([throws], options)
    wall_s = time.perf_counter() - started
    real, thrown = None, list(result["rows"])
    if options.folder.is_dir():
        real, mapped_too = study(load_demonstrations(options.folder), options)
        mapped += mapped_too
        result["rows"] += real["rows"]
    show("figure", "measured", "bar")
    show_throws(thrown, wall_s, throws.n)
    if real is not None:
        show_real(real["rows"])
    else:
        print(f"no recordings in {options.folder}: the real ones are left out", file=sys.stderr)
    if options.json is not None:
        write_json(options.json, result)
    if options.figures is not None:
        for path in write_mapping_figures(mapped, options.figures):
            print(f"wrote {path}")


if __name__ == "__main__":
    main()
