"""The default run, cold and warm, and the real recordings if they are at hand.

    python benchmarks/default_run.py [FOLDER OF PICK-AND-PLACE RECORDINGS]

Whole commands, as a user would type them, in a run folder of their own.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REAL = Path(os.environ.get("BESMAN_REAL_DATA", ROOT.parent / "shared" / "data")) / "pick_and_place"


def besman(*arguments: str) -> float:
    """Run a command; return its wall time, seconds."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "besman", *arguments]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start


def read(folder: Path, name: str) -> dict:
    return json.loads((folder / name).read_text())


def show(what: str, got: str, bar: str = "") -> None:
    print(f"{what:58}{got:>14}{bar:>12}")


def report_default(folder: Path) -> None:
    pipeline = ("run", "ur5_stick_throw", "--out", str(folder))
    cold, warm = besman(*pipeline), None
    stages = {row["name"]: row["wall_s"] for row in read(folder, "timing.json")["stages"]}
    warm = besman(*pipeline)
    results = read(folder, "results.json")
    refine, mapped = results["refine"], results["map"]
    show("figure", "measured", "bar")
    show("default run, cold cache, 16 throws, whole command [s]", f"{cold:.1f}", "60")
    show("  of which segmentation [s]", f"{stages['segment']:.2f}", "1")
    show(
        "  of which recognition (train, recognize) [s]",
        f"{stages['train'] + stages['recognize']:.3f}",
        "0.2",
    )
    show("default run, warm, whole command [s]", f"{warm:.1f}", "3")
    show("besman --help [s]", f"{besman('--help'):.2f}", "0.5")
    show(
        "throws within 5 cm after refinement",
        f"{refine['n_success']}/{refine['n_motions']}",
        "15/16",
    )
    show("  miss before, median / max [cm]", _pair(refine["miss_before_m"]))
    show("  miss after, median / max [cm]", _pair(refine["miss_m"]))
    show("mapped samples at 1 kHz outside a limit", str(mapped["limit_violations"]), "0")
    show("  in self-collision", str(mapped["self_collisions"]), "0")
    limits, collisions = check_exports(folder / "exports")
    show("exported samples at 1 kHz outside a limit", str(limits), "0")
    show("  in self-collision", str(collisions), "0")


def check_exports(folder: Path) -> tuple[int, int]:
    """Read the exported trajectories again and check every sample."""
    from besman.io.exports import read_joint_csv
    from besman.robot.limits import check_limits
    from besman.robot.model import load_robot

    robot = load_robot("ur5", "stick_holder")
    reports = [check_limits(robot, *read_joint_csv(file)[1:]) for file in folder.glob("*[0-9].csv")]
    return sum(r.violations for r in reports), sum(r.self_collisions for r in reports)


def _pair(summary: dict) -> str:
    return f"{100 * summary['median']:.1f} / {100 * summary['max']:.1f}"


def report_real(folder: Path, recordings: Path) -> None:
    spent = besman("run", "ur5_reach", "--out", str(folder), "--set", f"recordings={recordings}")
    results = read(folder, "results.json")
    segment, recognize, refine = (results[name] for name in ("segment", "recognize", "refine"))
    print(f"\nreal recordings ({results['label']['n_recordings']}), whole command {spent:.1f} s")
    show("segmentation F1, internal borders, margin 0.3 s", f"{segment['f1']:.3f}")
    show("  true / false positives a recording", f"{segment['tp']:.1f} / {segment['fp']:.1f}")
    show("  median border offset [s]", f"{segment['median_offset_s']:.3f}")
    show("recognition, 5 examples a class, detected segments", f"{recognize['accuracy']:.1%}")
    show("  manual segments", f"{recognize['accuracy_manual']:.1%}")
    show(
        "approach_forward refined to 1 cm and 5 degrees",
        f"{refine['n_success']}/{refine['n_motions']}",
    )


if __name__ == "__main__":
    real = Path(sys.argv[1]) if len(sys.argv) > 1 else REAL
    with tempfile.TemporaryDirectory() as temporary:
        report_default(Path(temporary) / "default")
        if real.is_dir():
            report_real(Path(temporary) / "real", real)
        else:
            print(f"\nno real recordings in {real}: left out")
