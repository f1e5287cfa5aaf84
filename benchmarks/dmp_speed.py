"""DMP rollouts and fits: one linear map against stepping (movement_primitives), in one run.

python benchmarks/dmp_speed.py [--candidates 1000]
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from besman.motion.cartesian_dmp import fit_poses, roll_out_poses
from besman.motion.dmp import roll_out
from besman.motion.dmp_fit import fit_weights
from besman.motion.velocity_dmp import fit_velocity_weights, roll_out_velocity

DURATION, STEP = 0.6, 0.01
SAMPLES = np.linspace(0, DURATION, round(DURATION / STEP) + 1)


def best_of(repeats: int, function: Callable[[], object]) -> float:
    """Return the shortest of several wall times, seconds."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def time_ours(count: int, n: int, k: int) -> dict[str, dict[str, float]]:
    """Time rollouts of `count` candidates, and one fit, of every kind; milliseconds each."""
    random = np.random.default_rng(0)
    weights = 300 * random.normal(size=(count, n, k))
    start, goal, v0, v1 = random.normal(size=(4, count, n))
    durations, leads = random.uniform(0.5, 0.6, count), np.zeros((count, 2))
    poses = random.normal(size=(2, count, 7))
    poses[..., 3:] /= np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True)
    turns = 300 * random.normal(size=(count, 6, k))
    joint = roll_out(weights[0], start[0], goal[0], DURATION, SAMPLES)[0]
    path = roll_out_poses(turns[0], poses[0, 0], poses[1, 0], DURATION, SAMPLES)
    calls: dict[str, dict[str, Callable[[], object]]] = {
        "joint_dmp": {
            "rollout": lambda: roll_out(weights, start, goal, DURATION, SAMPLES),
            "rollout_own_duration": lambda: roll_out(weights, start, goal, durations, SAMPLES),
            "fit": lambda: fit_weights(SAMPLES, joint, k),
        },
        "joint_dmp_velocity": {
            "rollout": lambda: roll_out_velocity(
                weights, start, goal, v0, v1, DURATION, leads[0], SAMPLES
            ),
            "rollout_own_duration": lambda: roll_out_velocity(
                weights, start, goal, v0, v1, durations, leads, SAMPLES
            ),
            "fit": lambda: fit_velocity_weights(SAMPLES, joint, v0[0], v1[0], k),
        },
        "cartesian_dmp": {
            "rollout": lambda: roll_out_poses(turns, poses[0], poses[1], DURATION, SAMPLES),
            "fit": lambda: fit_poses(SAMPLES, path, k),
        },
    }
    figures: dict[str, dict[str, float]] = {}
    for kind, parts in calls.items():
        figures[kind] = {}
        for part, call in parts.items():
            call()
            share = 1 if part == "fit" else count
            figures[kind][f"{part}_ms"] = 1e3 * best_of(15, call) / share
    return figures


def time_stepping(dmp: Any, demonstration: np.ndarray) -> dict[str, float]:
    """Time one rollout and one fit of a DMP of movement_primitives, milliseconds."""
    return {
        "stepping_rollout_ms": 1e3 * best_of(5, lambda: dmp.open_loop()),
        "stepping_fit_ms": 1e3 * best_of(5, lambda: dmp.imitate(SAMPLES, demonstration)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--candidates", type=int, default=1000)
    parser.add_argument("--joints", type=int, default=6)
    parser.add_argument("--weights", type=int, default=10)
    arguments = parser.parse_args()
    n, k, count = arguments.joints, arguments.weights, arguments.candidates
    figures: dict[str, Any] = time_ours(count, n, k)
    try:
        from movement_primitives.dmp import DMP, CartesianDMP, DMPWithFinalVelocity
    except ImportError:
        figures["movement_primitives"] = "not installed"
    else:
        random = np.random.default_rng(1)
        joint = roll_out(
            300 * random.normal(size=(n, k)), np.zeros(n), np.ones(n), DURATION, SAMPLES
        )[0]
        pose = np.array([0.0, 0, 0, 1, 0, 0, 0])
        path = roll_out_poses(300 * random.normal(size=(6, k)), pose, pose, DURATION, SAMPLES)
        options = {"n_weights_per_dim": k}
        others = {
            "joint_dmp": (DMP(n, DURATION, STEP, smooth_scaling=True, **options), joint),
            "joint_dmp_velocity": (DMPWithFinalVelocity(n, DURATION, STEP, **options), joint),
            "cartesian_dmp": (CartesianDMP(DURATION, STEP, smooth_scaling=True, **options), path),
        }
        for kind, (dmp, demonstration) in others.items():
            dmp.configure(start_y=demonstration[0], goal_y=demonstration[-1])
            ours = figures[kind]
            ours |= time_stepping(dmp, demonstration)
            ours["rollout_ratio"] = ours["stepping_rollout_ms"] / ours["rollout_ms"]
            ours["fit_ratio"] = ours["stepping_fit_ms"] / ours["fit_ms"]
    print(json.dumps({"candidates": count, "samples": len(SAMPLES)} | figures, indent=2))


if __name__ == "__main__":
    main()
