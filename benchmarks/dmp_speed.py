"""DMP rollouts and fits: one linear map against stepping (movement_primitives), in one run.

python benchmarks/dmp_speed.py [--candidates 1000]
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable

import numpy as np

from besman.imitation.dmp import fit_weights, roll_out


def best_of(repeats: int, function: Callable[[], object]) -> float:
    """Return the shortest of several wall times, seconds."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--candidates", type=int, default=1000)
    parser.add_argument("--joints", type=int, default=6)
    parser.add_argument("--weights", type=int, default=10)
    arguments = parser.parse_args()
    n, k, count = arguments.joints, arguments.weights, arguments.candidates
    random = np.random.default_rng(0)
    weights = 300 * random.normal(size=(count, n, k))
    start, goal = random.normal(size=(2, count, n))
    duration, step = 0.6, 0.01
    samples = np.linspace(0, duration, round(duration / step) + 1)
    roll_out(weights[:2], start[:2], goal[:2], duration, samples)

    ours = best_of(5, lambda: roll_out(weights, start, goal, duration, samples))
    durations = random.uniform(0.5, 0.6, count)
    own = best_of(5, lambda: roll_out(weights, start, goal, durations, samples))
    demonstration = roll_out(weights[0], start[0], goal[0], duration, samples)[0]
    ours_fit = best_of(5, lambda: fit_weights(samples, demonstration, k))
    result: dict[str, object] = {
        "candidates": count,
        "samples": len(samples),
        "rollout_ms_per_candidate": 1e3 * ours / count,
        "rollout_own_duration_ms_per_candidate": 1e3 * own / count,
        "fit_ms": 1e3 * ours_fit,
    }
    try:
        from movement_primitives.dmp import DMP
    except ImportError:
        result["movement_primitives"] = "not installed"
    else:
        dmp = DMP(n, duration, step, n_weights_per_dim=k, smooth_scaling=True)
        dmp.forcing_term.weights_[:] = weights[0]
        dmp.configure(start_y=start[0], goal_y=goal[0])
        stepping = best_of(5, lambda: dmp.open_loop())
        imitate = best_of(5, lambda: dmp.imitate(samples, demonstration))
        result |= {
            "stepping_ms_per_candidate": 1e3 * stepping,
            "stepping_fit_ms": 1e3 * imitate,
            "rollout_ratio": stepping * count / ours,
            "fit_ratio": imitate / ours_fit,
        }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
