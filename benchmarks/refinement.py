"""Searches on functions with public figures and on simulated tasks.

    python benchmarks/refinement.py [--seeds N] [--runs N] [--jobs N] [--figures DIR] [--json FILE]
                                    [--task NAME ...]

Prints the tables of ``besman evaluate refinement``, all searches with N seeds from 0 on, then the
benchmark of approximate inverse kinematics as it was published: CMA-ES, initial standard deviation
100 (Cartesian) or 200 (joint), 30 runs of 2000 episodes, seeds 100 to 129.
"""

import argparse
import os
import time
from pathlib import Path

from rich.console import Console

from besman.evaluation.approximate_ik import PUBLIC
from besman.evaluation.refinement import evaluate_refinement
from besman.evaluation.refinement_problems import load_problem
from besman.evaluation.refinement_tables import refinement_tables, write_curves
from besman.io.atomic_files import write_json
from besman.work.work import Work
from besman.work.workers import Workers

FUNCTIONS = ("sphere", "rosenbrock", "contextual_sphere", "contextual_rosenbrock", "via_points")
ARM = {
    "via_points": ("via_points", "cartesian"),
    "via_points_joint": ("via_points", "joint"),
    "obstacles": ("obstacles", "cartesian"),
    "obstacles_joint": ("obstacles", "joint"),
}
FIRST_SEED = 100
BAR = {"via_points": "-5.5"}


def show(what: str, got: str, public: str = "", bar: str = "") -> None:
    print(f"{what:44}{got:>18}{public:>18}{bar:>8}", flush=True)


def mean(values: dict) -> str:
    return f"{values['mean']:.2f} +- {values['standard_error']:.2f}"


def compare(options: argparse.Namespace, workers: Workers) -> list:
    rows, console = [], Console(width=120)
    for name in (*FUNCTIONS, *options.task):
        started = time.perf_counter()
        work = Work(options.jobs, workers=workers)
        result = evaluate_refinement([load_problem(name)], seeds=range(options.seeds), work=work)
        for table in refinement_tables(result["rows"]):
            console.print(table)
        print(f"{time.perf_counter() - started:.0f} s by the clock\n", flush=True)
        rows += result["rows"]
    return rows


def repeat_published(options: argparse.Namespace, workers: Workers) -> list:
    rows = []
    show("best reward, CMA-ES", "measured", "public", "bar")
    for name, key in ARM.items():
        work = Work(options.jobs, workers=workers)
        seeds = range(FIRST_SEED, FIRST_SEED + options.runs)
        (row,) = evaluate_refinement([load_problem(name)], ["cma_es"], seeds, work)["rows"]
        for mark, (middle, error) in zip((500, 2000), PUBLIC[key], strict=True):
            bar = BAR.get(name, "") if mark == 2000 else ""
            got = mean(row["rewards_at"][mark])
            show(f"{name} after {mark} episodes", got, f"{middle:g} +- {error:g}", bar)
        rows.append({**row, "dataset": f"{name}_as_published"})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--task", action="append")
    parser.add_argument("--figures", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    options.task = options.task or ["stick_throw"]
    with Workers(options.jobs) as workers:
        rows = compare(options, workers)
        rows += repeat_published(options, workers)
    if options.json is not None:
        write_json(options.json, {"experiment": "refinement", "rows": rows})
    if options.figures is not None:
        for path in write_curves(rows, options.figures):
            print(f"wrote {path}")


if __name__ == "__main__":
    main()
