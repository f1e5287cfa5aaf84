"""Wipes, synthetic: how far every kind of imitation is beside the mapped path, and its cost.

    python benchmarks/imitation.py [--circles 1 4 12] [--base FOLDER] [--json FILE]

A wipe is circles of radius 12 cm above a table, 1.475 s each, at constant speed or from rest to
rest, mapped to a UR5 with its gripper. With `--base`, an older checkout, the same mapped
trajectories are imitated by that one as well, in a process of its own with its own defaults. The
error is the distance of the tool from where the mapped path has it at the same time.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import timeit
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from besman.records import AnyPlan, HandTrajectory, JointTrajectory
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot, load_robot

try:
    from besman.motion.dmp import roll_out
    from besman.motion.rollout import sample_plan
    from besman.records.files import load_record, save_record
    from besman.stages.imitate.stage import CartesianDmpConfig, ImitateConfig, VelocityDmpConfig
except ImportError:
    # A checkout of before the modules moved, as `--base`.
    from besman.imitation.dmp import roll_out
    from besman.imitation.movement import sample_plan
    from besman.imitation.stage import CartesianDmpConfig, ImitateConfig, VelocityDmpConfig
    from besman.record_files import load_record, save_record

CIRCLE_S, RADIUS_M, RATE_HZ, BAR_MM = 1.475, 0.12, 100.0, 3.0
CONFIGS = (
    ImitateConfig(),
    VelocityDmpConfig(method="joint_dmp_velocity"),
    CartesianDmpConfig(method="cartesian_dmp"),
)


def wipe(circles: int, from_rest: bool) -> HandTrajectory:
    """Make a wipe; synthetic."""
    n = round(circles * CIRCLE_S * RATE_HZ)
    x = np.arange(n + 1) / n
    share = 10 * x**3 - 15 * x**4 + 6 * x**5 if from_rest else x
    angle = 2 * np.pi * circles * share
    poses = np.zeros((n + 1, 7))
    poses[:, 0] = 0.45 + RADIUS_M * np.cos(angle)
    poses[:, 1] = RADIUS_M * np.sin(angle)
    poses[:, 2], poses[:, 4] = -0.1, 1.0
    kind = "rest to rest" if from_rest else "constant speed"
    return HandTrajectory(
        time=np.arange(n + 1) / RATE_HZ, poses=poses, name=f"{circles} circles, {kind}", label="w"
    )


def measure(trajectories: tuple[JointTrajectory, ...], robot: Robot) -> list[dict[str, Any]]:
    """Imitate by every kind; errors in mm, seconds of the fit and milliseconds of a rollout."""
    rows = []
    for trajectory in trajectories:
        path = forward_kinematics(robot.chain, trajectory.positions)[:, :3, 3]
        for config in CONFIGS:
            start = time.perf_counter()
            plans = config.run((trajectory,), robot)
            fit_s = time.perf_counter() - start
            error = distance_mm(plans[0], trajectory, path, config.lead_in_s, robot)
            rollout_s = min(timeit.repeat(partial(sample_plan, plans[0], robot), number=1))
            rows.append(
                {
                    "wipe": trajectory.name,
                    "method": config.method,
                    "duration_s": float(trajectory.time[-1]),
                    "n_weights": int(plans[0].weights.shape[1]),
                    "max_mm": float(error.max()),
                    "rms_mm": float(np.sqrt(np.mean(error**2))),
                    "fit_s": fit_s,
                    "rollout_ms": 1e3 * rollout_s,
                }
            )
    return rows


def distance_mm(
    plan: AnyPlan, trajectory: JointTrajectory, path: np.ndarray, since_s: float, robot: Robot
) -> np.ndarray:
    """Return the tool's distance at the samples of the trajectory, from a rollout at 1 kHz."""
    at, positions, _, _ = sample_plan(plan, robot)
    q = np.column_stack([np.interp(trajectory.time + since_s, at, one) for one in positions.T])
    distance: np.ndarray = 1e3 * np.linalg.norm(
        forward_kinematics(robot.chain, q)[:, :3, 3] - path, axis=1
    )
    return distance


def measure_base(base: Path, trajectories: tuple[JointTrajectory, ...]) -> list[dict[str, Any]]:
    """Have another checkout imitate the same trajectories."""
    with tempfile.TemporaryDirectory() as folder:
        place, out = Path(folder) / "trajectories.npz", Path(folder) / "rows.json"
        save_record(trajectories, place)
        subprocess.run(
            [sys.executable, __file__, "--mapped", str(place), "--json", str(out)],
            env=os.environ | {"PYTHONPATH": str(base.resolve())},
            check=True,
            stdout=subprocess.DEVNULL,
        )
        rows: list[dict[str, Any]] = json.loads(out.read_text())
        return rows


def show(rows: list[dict[str, Any]], before: list[dict[str, Any]]) -> None:
    """Print a row each, that of the base beside it."""
    print(
        f"{'wipe':27}{'method':20}{'s':>5}{'weights':>8}{'max mm':>8}{'rms mm':>8}{'fit s':>7}"
        f"{'rollout ms':>11}" + ("   base: weights  max mm  rollout ms" if before else "")
    )
    for at, row in enumerate(rows):
        line = (
            f"{row['wipe']:27}{row['method']:20}{row['duration_s']:5.1f}{row['n_weights']:8}"
            f"{row['max_mm']:8.2f}{row['rms_mm']:8.2f}{row['fit_s']:7.2f}{row['rollout_ms']:11.2f}"
        )
        if before:
            old = before[at]
            line += f"{old['n_weights']:17}{old['max_mm']:8.1f}{old['rollout_ms']:12.2f}"
        print(line)
    worst = max(row["max_mm"] for row in rows)
    print(f"greatest error: {worst:.2f} mm, bar: {BAR_MM:g} mm")


def show_rollouts(robot: Robot) -> None:
    """Print what a rollout at 1 kHz costs where weights and duration grow together."""
    print("rollout of a joint_dmp at 1 kHz, processor time, best of 9:")
    random = np.random.default_rng(0)
    for n_weights in (20, 80, 160, 320, 640):
        seconds = 0.075 * n_weights
        weights, start = random.normal(size=(robot.n, n_weights)), np.zeros(robot.n)
        times = np.arange(round(1000 * seconds) + 1) / 1000
        spent = min(
            timeit.repeat(
                partial(roll_out, weights, start, start, seconds, times),
                number=1,
                repeat=9,
                timer=time.process_time,
            )
        )
        print(f"  {n_weights:4} weights, {seconds:5.1f} s: {1e3 * spent:6.2f} ms")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--circles", type=int, nargs="+", default=[1, 4, 12])
    parser.add_argument("--base", type=Path, help="checkout of an older build")
    parser.add_argument("--mapped", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    robot = load_robot("ur5", "gripper")
    if options.mapped:
        trajectories = load_record(options.mapped)
    else:
        hands = [wipe(n, rest) for rest in (False, True) for n in options.circles]
        from besman.stages.map.stage import MapConfig

        settings = MapConfig(evaluations=60)
        trajectories = tuple(settings.run((hand,), robot).trajectories[0] for hand in hands)
    rows = measure(trajectories, robot)
    before = measure_base(options.base, trajectories) if options.base else []
    show(rows, before)
    if not options.mapped:
        show_rollouts(robot)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
