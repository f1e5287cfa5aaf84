"""Limits: the stretch of time with and without a change of the tool's path, and what it costs.

Synthetic stick throws are mapped without a change; then the same joint paths are scaled both ways.
Last the convex program alone: solves a second.

    python benchmarks/limits.py [--throws 40] [--robots ur5 ur10 iiwa7 compi]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from besman.evaluation.mapping_data import simulate_throw_set
from besman.records import JointTrajectory
from besman.robot.limits import check_limits, resample_trajectory
from besman.robot.model import Robot, load_robot
from besman.stages.map.joint_spline import JointSpline, fit_spline
from besman.stages.map.limit_program import solve_change
from besman.stages.map.needed_stretch import ChangeTolerance
from besman.stages.map.path_change import PathChange
from besman.stages.map.stage import MapConfig
from besman.stages.map.time_scaling import scale_path

TOLERANCE = ChangeTolerance(free_spin=True)
PLAIN = ChangeTolerance(position=0.0, free_spin=True)


def compare(robot: Robot, paths: list[JointTrajectory]) -> str:
    """Scale every path both ways."""
    rows: dict[str, list[list[float]]] = {"plain": [], "changed": []}
    for path in paths:
        before = path.time / path.time_stretch
        for name, tolerance in (("plain", PLAIN), ("changed", TOLERANCE)):
            start = time.process_time()
            scaled = scale_path(robot, before, path.positions, tolerance=tolerance)
            spent = time.process_time() - start
            _, *dense = resample_trajectory(
                scaled.time, scaled.positions, scaled.velocities, scaled.accelerations
            )
            errors = PathChange(robot, path.positions, TOLERANCE).errors(scaled.positions)
            way = np.linalg.norm(errors[:, 0], axis=1)
            report = check_limits(robot, *dense)
            rows[name].append([scaled.stretch, spent, way.mean(), way.max(), report.violations])
    plain, changed = (np.array(values) for values in rows.values())
    parts = [
        f"{np.median(values[:, 0]):.2f} / {values[:, 0].max():.2f}" for values in (plain, changed)
    ]
    parts += [f"{100 * np.mean(values[:, 0] <= 1.0001):.0f} %" for values in (plain, changed)]
    parts.append(f"{1e3 * changed[:, 2].mean():.1f} / {1e3 * changed[:, 3].max():.1f} mm")
    parts += [f"{1e3 * values[:, 1].mean():.0f} ms" for values in (plain, changed)]
    parts.append(f"{plain[:, 4].sum() + changed[:, 4].sum():.0f}")
    return " | ".join(parts)


def solve_rate(robot: Robot, path: JointTrajectory, repeats: int = 20) -> str:
    """Solve one program again and again."""
    spline: JointSpline = fit_spline(path.time / path.time_stretch, path.positions, 0.05)
    metric = PathChange(robot, path.positions, TOLERANCE).metric(spline)
    start = time.process_time()
    solve_change(spline, metric, robot.limits, 1.0)
    first = time.process_time() - start
    start = time.process_time()
    for _ in range(repeats):
        change = solve_change(spline, metric, robot.limits, 1.0)
    each = (time.process_time() - start) / repeats
    moved = spline.moved(spline.points + change)
    excess = max(
        np.max(np.abs(moved.velocity_points()) / robot.limits.velocity),
        np.max(np.abs(moved.acceleration_points()) / robot.limits.acceleration),
    )
    return f"{1 / each:.0f} | {1e3 * first:.0f} ms | {max(excess - 1.0, 0.0):.0e}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--throws", type=int, default=40)
    parser.add_argument("--robots", nargs="+", default=["ur5", "ur10", "iiwa7", "compi"])
    arguments = parser.parse_args()
    throws = simulate_throw_set(
        n_subjects=4, n_repetitions=-(-arguments.throws // 4)
    ).demonstrations
    config = MapConfig(free_axis_spin=True, greatest_change_m=0.0)
    print("robot | stretch plain | changed | unscaled plain | changed | change mean / max", end="")
    print(" | CPU plain | changed | samples beyond a limit")
    for name in arguments.robots:
        robot = load_robot(name, "stick_holder")
        paths = list(config.run(throws[: arguments.throws], robot).trajectories)
        scale_path(robot, paths[0].time / 10, paths[0].positions, tolerance=TOLERANCE)
        print(f"{name} | {compare(robot, paths)}", flush=True)
    print(f"\nsolves a second ({robot.n} joints) | first | beyond the limits")
    print(solve_rate(robot, paths[0]))


if __name__ == "__main__":
    main()
