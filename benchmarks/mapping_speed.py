"""What mapping 16 synthetic throws costs on arms that are not UR, against the UR5 in the same run.

    python benchmarks/mapping_speed.py [--against CHECKOUT] [--runs 3] [--jobs 2] [--only WORD]

Arms of the installed example-robot-data are brought in by their file first. CPU seconds are of all
threads, medians of runs after a first one that loads what is needed. With --against the UR5's
throws are mapped by another checkout of besman as well, each in a process of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from importlib import metadata
from pathlib import Path

TOP = Path(__file__).resolve().parents[1]
SHARED = "cmeel.prefix/share/example-robot-data/robots"
FILES = {
    "kinova": "kinova_description/robots/kinova.urdf",
    "z1": "z1_description/urdf/z1.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
    "panda": "panda_description/urdf/panda.urdf",
}
OWN = ("ur5", "ur10", "compi", "iiwa7")
BARS = {6: 1.5, 7: 3.0}


def measure(robot: str, runs: int, jobs: int) -> dict[str, object]:
    """Map the throws; also run by an older checkout, whose modules stand elsewhere."""
    from besman.evaluation.mapping_data import simulate_throw_set
    from besman.robot.model import load_robot

    try:
        from besman.stages.map.stage import MapConfig, map_results
        from besman.work.work import Work
    except ImportError:
        from besman.mapping.stage import MapConfig, map_results

        from besman.work import Work
    from threadpoolctl import threadpool_limits

    throws = simulate_throw_set(2, 8).demonstrations
    arm, config = load_robot(robot, "stick_holder"), MapConfig(free_axis_spin=True)
    spent: list[tuple[float, float]] = []
    with threadpool_limits(limits=1, user_api="blas"):
        for _ in range(runs + 1):
            start, work = time.perf_counter(), time.process_time()
            mapping = config.run(throws, arm, Work(jobs=jobs))
            spent.append((time.perf_counter() - start, time.process_time() - work))
    found = map_results(mapping)
    return {
        "n": arm.n,
        "first_s": spent[0][0],
        "first_cpu_s": spent[0][1],
        "wall_s": statistics.median(one for one, _ in spent[1:]),
        "cpu_s": statistics.median(one for _, one in spent[1:]),
        "mapped": found["n_transferred"],
        "corrected": len(found["corrected"]),
        "p95_mm": 1e3 * found["position_error_m"]["p95"],
        "stretch": found["time_stretch"]["median"],
        "violations": found["limit_violations"],
        "collisions": found["self_collisions"],
    }


def measure_in(checkout: Path, robot: str, options: argparse.Namespace) -> dict[str, object]:
    """Do the same in a process of its own, by the besman of a checkout."""
    words = [sys.executable, str(Path(__file__).resolve()), "--measure", robot]
    words += ["--runs", str(options.runs), "--jobs", str(options.jobs)]
    settings = os.environ | {"PYTHONPATH": str(checkout)}
    done = subprocess.run(words, env=settings, capture_output=True, text=True, check=False)
    if done.returncode:
        return {"error": (done.stderr.strip().splitlines() or ["?"])[-1]}
    return json.loads(done.stdout.splitlines()[-1])


def bring_arms(folder: Path, only: str) -> dict[str, str]:
    """Return the arms to measure by name: those of besman and those of example-robot-data."""
    from besman.robot.new_robot import add_robot

    robots = {name: name for name in OWN}
    shared = Path(str(metadata.distribution("example-robot-data").locate_file(SHARED)))
    for name, file in FILES.items():
        if only in name:
            robots[name] = str(add_robot(shared / file, name=f"a_{name}", folder=folder / name))
    return {name: path for name, path in robots.items() if only in name or name == "ur5"}


def main() -> None:
    """Print a line for each arm."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", default="")
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        print(json.dumps(measure(options.measure, options.runs, options.jobs)))
        return
    with tempfile.TemporaryDirectory() as place:
        robots = bring_arms(Path(place), options.only)
        print(f"{'arm':10}{'joints':>7}{'mapped':>8}{'CPU s':>8}{'/ UR5':>7}{'bar':>5}"
              f"{'p95 mm':>8}{'stretch':>9}{'outside / touching':>20}")  # fmt: skip
        ur5 = None
        for name, path in robots.items():
            row = measure_in(TOP, path, options)
            if "error" in row:
                print(f"{name:10} {row['error']}")
                continue
            ur5 = ur5 or row
            touching = f"{row['violations']} / {row['collisions']}"
            print(f"{name:10}{row['n']:7}{row['mapped']:8}{row['cpu_s']:8.2f}"
                  f"{row['cpu_s'] / ur5['cpu_s']:7.2f}{BARS[row['n']]:5.1f}{row['p95_mm']:8.2f}"
                  f"{row['stretch']:9.2f}{touching:>20}", flush=True)  # fmt: skip
        if options.against and ur5:
            old = measure_in(options.against, "ur5", options)
            if "error" in old:
                sys.exit(f"{options.against}: {old['error']}")
            for what, key in (("CPU", "cpu_s"), ("CPU, first in a process", "first_cpu_s")):
                print(f"UR5, {what}: {ur5[key]:.2f} s, {options.against.name} {old[key]:.2f} s, "
                      f"{old[key] / ur5[key]:.1f} times faster (bar 3)")  # fmt: skip


if __name__ == "__main__":
    main()
