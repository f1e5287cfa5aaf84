"""Templates of a run: where its motions for unseen contexts come down, simulated.

python benchmarks/templates.py [RUN] [--method c_reps ...] [--seed 0 ...] [--json FILE]

RUN is a finished run, which is not changed; without one, `ur5_stick_throw` is run first.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from besman.config.resources import find_resource
from besman.config.stage import Work
from besman.exceptions import PlanError
from besman.pipeline.config import load_pipeline
from besman.pipeline.finished_run import read_run
from besman.pipeline.pipeline import run_pipeline
from besman.simulation.trial import try_plans
from besman.templates.applying import apply_template
from besman.templates.files import parse_settings
from besman.templates.teaching import prepare_lesson, teach

_UNSEEN = 4711


def measure(
    folder: Path, given: dict[str, Any], settings: tuple[str, ...], targets: int, jobs: int
) -> dict[str, Any]:
    """Learn one template and apply it to contexts that it has not seen."""
    run = read_run(folder)
    config = parse_settings(given, settings)
    lesson = prepare_lesson(run.motions, run.robot, run.task, (), {}, config)
    start = time.perf_counter()
    template = teach(lesson, config, run.labels, Work(jobs))
    learning_s = time.perf_counter() - start
    random = np.random.default_rng((config.seed, _UNSEEN))
    contexts = random.uniform(*lesson.region, (targets, lesson.region.shape[1]))
    plans, forecasts, seconds, refused, slowed = [], [], [], 0, 0
    for context in contexts:
        try:
            applied = apply_template(template, run.robot, run.task, context)
        except PlanError:
            refused += 1
            continue
        plans.append(applied.plan)
        forecasts.append(applied.forecast)
        seconds.append(applied.wall_s)
        slowed += any("slowed down" in warning for warning in applied.warnings)
    trials = try_plans(run.robot, run.task, plans, jobs)
    misses = np.array([np.inf if trial.failure else trial.miss for trial in trials])
    misses = np.append(misses, np.full(refused, np.inf))
    rewards = np.array([trial.reward for trial in trials])
    expected = np.array([one.reward for one in forecasts])
    spread = np.array([one.reward_spread for one in forecasts])
    return {
        "dataset": folder.name,
        "source": "synthetic",
        "method": config.method,
        "seed": config.seed,
        "episodes": len(template.tries.rewards),
        "region": lesson.region.tolist(),
        "targets": targets,
        "miss_m": {
            "median": float(np.median(misses)),
            "p90": float(np.quantile(misses, 0.9)),
            "max": float(misses.max()),
        },
        "success_share": sum(trial.success for trial in trials) / targets,
        "failed": int(np.isinf(misses).sum()),
        "refused": refused,
        "slowed": slowed,
        "apply_ms": {
            "median": 1e3 * float(np.median(seconds)),
            "first": 1e3 * seconds[0],
        },
        "forecast_error": float(np.median(np.abs(rewards - expected))),
        "within_two_spreads": float(np.mean(np.abs(rewards - expected) <= 2 * spread)),
        "learning_s": learning_s,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", nargs="?", type=Path)
    parser.add_argument("--method", nargs="+", default=["c_reps", "c_cma_es"])
    parser.add_argument("--seed", type=int, nargs="+", default=[0])
    parser.add_argument("--episodes", type=int, default=3000)
    parser.add_argument("--targets", type=int, default=200)
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if options.run is None:
            config = load_pipeline(find_resource("pipelines", "ur5_stick_throw"))
            options.run = run_pipeline(config, Path(folder) / "run", jobs=options.jobs)
        _measure_all(options)


def _measure_all(options: argparse.Namespace) -> None:
    """Print a line for each method and seed."""
    rows = []
    for method in options.method:
        for seed in options.seed:
            given = {"method": method, "seed": seed, "episodes": options.episodes}
            settings = tuple(options.set)
            row = measure(options.run, given, settings, options.targets, options.jobs)
            rows.append(row)
            miss, apply = row["miss_m"], row["apply_ms"]
            print(
                f"{method} seed {seed}: miss {100 * miss['median']:.1f} cm (90 %: "
                f"{100 * miss['p90']:.1f}), {100 * row['success_share']:.0f} % succeed, "
                f"{row['failed']} fail ({row['refused']} refused, {row['slowed']} slowed), apply "
                f"{apply['median']:.0f} ms (first {apply['first']:.0f}), "
                f"learning {row['learning_s']:.0f} s",
                flush=True,
            )
            if options.json:
                content = {"experiment": "templates", "rows": rows}
                options.json.write_text(json.dumps(content, indent=2) + "\n")


if __name__ == "__main__":
    main()
