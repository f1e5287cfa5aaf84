"""Simulated stick throws on four arms: how far they miss as imitated, and after refinement.

    python benchmarks/throws.py [--all] [--robust]

34 throws of 3 simulated people (as the thesis' second dataset), each arm's own recipe, at most 300
episodes a throw. With ``--all`` also the 697 throws of the first dataset on the UR5, imitated only.
``--robust`` instead: the whole recipe, its search robust, on throws of two of its people and on all
697, and what that costs; two sizes tell whether it is linear in their number.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROBOTS = ("ur5", "ur10", "iiwa7", "compi")
NAMED = "label={method: named, markers: right_arm}"


def besman(*arguments: str) -> None:
    command = [sys.executable, "-m", "besman", *arguments]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit(done.stderr)


def run(robot: str, recordings: Path, out: Path, *settings: str) -> dict:
    options = (f"recordings={recordings}", NAMED, "refine.robustness=null", *settings)
    sets = [part for option in options for part in ("--set", option)]
    besman("run", f"{robot}_stick_throw", "--out", str(out), *sets)
    results = json.loads((out / "results.json").read_text())
    stages = json.loads((out / "timing.json").read_text())["stages"]
    (cpu_s,) = (row["cpu_s"] for row in stages if row["name"] == "refine")
    return {**results["refine"], "mapped": results["map"]["n_transferred"], "cpu_s": cpu_s}


def spread(values: dict) -> str:
    return " / ".join(f"{100 * values[key]:.1f}" for key in ("median", "max"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--all", action="store_true", help="also 697 throws, imitated only")
    parser.add_argument("--robust", action="store_true", help="697 throws, refined robustly")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if chosen.robust:
            for subjects in (2, 7):
                tell_robust(folder, subjects)
            return
        besman("synth", "stick_throw_marked", "--out", str(folder / "34"))
        print("34 throws (synthetic): within 5 cm, bar 98 % within 300 episodes each")
        for robot in ROBOTS:
            row = run(robot, folder / "34", folder / robot, "refine.episodes=300")
            print(
                f"  {robot:6} {row['n_success']} of {row['n_motions']} (mapped {row['mapped']}), "
                f"miss before {spread(row['miss_before_m'])} cm, after {spread(row['miss_m'])} cm "
                f"(median / max), episodes {row['episodes']['median']:.0f} / "
                f"{row['episodes']['max']:.0f}, {row['cpu_s']:.0f} s of CPU",
                flush=True,
            )
        if chosen.all:
            besman("synth", "stick_throw", "--out", str(folder / "697"))
            row = run("ur5", folder / "697", folder / "all", "refine.episodes=1")
            print(f"697 throws (synthetic), UR5, imitated only: {imitated(folder / 'all')}")


def tell_robust(folder: Path, subjects: int) -> None:
    """Refine the first dataset's throws of so many people robustly; print what it took."""
    data, out = folder / f"data{subjects}", folder / f"robust{subjects}"
    besman("synth", "stick_throw", "--out", str(data), "--subjects", str(subjects))
    began = time.perf_counter()
    besman(
        "run", "ur5_stick_throw", "--out", str(out), "--set", f"recordings={data}", "--set", NAMED
    )
    wall_s = time.perf_counter() - began
    results = json.loads((out / "results.json").read_text())
    stages = json.loads((out / "timing.json").read_text())["stages"]
    (refine,) = (row for row in stages if row["name"] == "refine")
    workers = max(row.get("workers", {}).get("peak_rss_mb") or 0.0 for row in stages)
    found, n = results["refine"], results["refine"]["n_motions"]
    print(
        f"{n} throws (synthetic) of {subjects} people, UR5, robust: {found['n_success']} hit; "
        f"whole run {wall_s:.0f} s, refine {refine['wall_s']:.0f} s "
        f"({1e3 * refine['wall_s'] / n:.0f} ms each, {refine['cpu_s']:.0f} s of CPU), "
        f"episodes {found['episodes']['median']:.0f} / "
        f"{found['episodes']['max']:.0f}; a worker's memory {workers:.0f} MB, of the command "
        f"{max(row['peak_rss_mb'] for row in stages):.0f} MB",
        flush=True,
    )


def imitated(run_folder: Path) -> str:
    from besman.records.files import load_record

    motions = load_record(next(run_folder.glob("*_refine")) / "record.npz")
    misses = np.array([motion.miss_before for motion in motions])
    landed = np.isfinite(misses)
    return (
        f"{landed.sum()} of {len(misses)} throws landed, miss {misses[landed].mean():.2f} +- "
        f"{misses[landed].std():.2f} m, median {np.median(misses[landed]):.2f} m"
    )


if __name__ == "__main__":
    main()
