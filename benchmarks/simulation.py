"""Simulated tasks: throughput of full episodes, shift at a quarter of the time step, robustness.

    python benchmarks/simulation.py [TASK ...] [--boxes N]

Every task starts from its recipe of `pipelines/` and the embedded recordings. Throughput counts
rollout of the motion plan, feed-forward, simulation and reward, in two threads; on a busy machine
the CPU's figure is the one to look at.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

# One thread a matrix product: set before numpy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from besman.config.resources import find_resource
from besman.pipeline.config import PipelineConfig, load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.records import AnyPlan, RefinedMotion
from besman.records.files import load_record
from besman.robot.model import Robot, load_robot
from besman.simulation.perturbed_trials import finer_task, lenient_task
from besman.simulation.task import Task
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.refine.plan_space import plan_space
from besman.stages.refine.robustness import RobustConfig, RobustnessConfig

RECIPES = {
    "stick_throw": "ur5_stick_throw",
    "ball_throw": "compi_ball_throw",
    "grasp_box": "iiwa7_grasp",
    "pull_lever": "ur10_lever",
}
N_EPISODES, N_BOXES = 160, 100
# Models that judge races, which no search has seen.
N_JUDGES, JUDGE = 20, 20


def changed(task: Task, **sections: dict[str, Any]) -> Task:
    """Return a task with other values in some sections."""
    return task.model_copy(
        update={name: getattr(task, name).model_copy(update=new) for name, new in sections.items()}
    )


def refined(name: str, folder: Path) -> tuple[PipelineConfig, tuple[RefinedMotion, ...], float]:
    """Run a recipe; return it, its motions, and the wall time of their refinement."""
    config = load_pipeline(find_resource("pipelines", RECIPES[name]))
    run_pipeline(config, folder / name, jobs=2)
    (record,) = (folder / name).glob("[0-9][0-9]_refine/record.npz")
    timing = json.loads((folder / name / "timing.json").read_text())
    wall = next(one["wall_s"] for one in timing["stages"] if one["name"] == "refine")
    return config, load_record(record), wall


def imitated(name: str, folder: Path) -> tuple[AnyPlan, ...]:
    """Return the imitations of a recipe that was run."""
    (record,) = (folder / name).glob("[0-9][0-9]_imitate/record.npz")
    return load_record(record)


def show(what: str, got: str, bar: str = "") -> None:
    print(f"  {what:<44}{got:<44}{bar}", flush=True)


def first_success(motions: tuple[RefinedMotion, ...], task: Task) -> str:
    """Count the episodes until the miss is within the task's radius for the first time."""
    within = [motion.misses <= task.success_radius_m for motion in motions]
    counts = [1 + int(one.argmax()) if one.any() else len(one) for one in within]
    return f"{np.median(counts):.0f} median, {max(counts)} most"


def measure_throughput(robot: Robot, task: Task, motion: RefinedMotion) -> None:
    """Time episodes of plans around a refined one."""
    space = plan_space(motion.plan, robot, ("goal", "duration", "weights"), 4)
    random = np.random.default_rng(0)
    points = 0.1 * random.normal(size=(N_EPISODES, space.dimension))
    plans = [space.plan_at(point) for point in points]
    try_plans(robot, task, plans[:16], 2)
    wall = cpu = np.inf
    for _ in range(3):
        start, start_cpu = time.perf_counter(), time.process_time()
        try_plans(robot, task, plans, 2)
        wall = min(wall, time.perf_counter() - start)
        cpu = min(cpu, time.process_time() - start_cpu)
    show(
        "episodes a second, 2 threads",
        f"{N_EPISODES / wall:.0f} (2 CPU seconds: {2 * N_EPISODES / cpu:.0f})",
        "200",
    )


def measure_step(robot: Robot, task: Task, motions: tuple[RefinedMotion, ...]) -> None:
    """Repeat refined motions at a quarter of the time step."""
    done = [motion for motion in motions if motion.success]
    plans = [motion.plan for motion in done]
    usual, other = (try_plans(robot, one, plans, 2) for one in (task, finer_task(task)))
    shifts = [
        float(np.linalg.norm(a.outcome - b.outcome)) for a, b in zip(usual, other, strict=True)
    ]
    show(
        "outcome's shift at dt/4",
        f"{100 * np.nanmedian(shifts):.2f} cm median, {100 * np.nanmax(shifts):.2f} cm max",
        "2 cm median",
    )
    show("success at dt/4", f"{sum(one.success for one in other)} of {len(other)}")


def measure_boxes(
    robot: Robot, task: Task, motions: tuple[RefinedMotion, ...], n_boxes: int
) -> None:
    """Try refined grasps on boxes up to 2 cm, and 5 degrees, from where they should be."""
    random = np.random.default_rng(0)
    radius = 0.02 * np.sqrt(random.uniform(size=n_boxes))
    angle = random.uniform(0, 2 * np.pi, n_boxes)
    shifts = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    for turn_deg in (0.0, 5.0):
        turns = random.uniform(-turn_deg, turn_deg, n_boxes)
        counts = []
        for motion in motions:
            trials = []
            for shift, turn in zip(shifts, turns, strict=True):
                box = {"shift_m": tuple(shift.tolist()), "turn_deg": float(turn), "spread_m": 0.0}
                one = changed(task, box=box)
                trials += try_plans(robot, one, [one.place(motion.plan, robot)])
            counts.append(sum(trial.success for trial in trials))
        show(
            f"boxes within 2 cm, +-{turn_deg:g} degrees, of {n_boxes}",
            " ".join(str(count) for count in counts),
            "95",
        )


def measure_races(
    config: PipelineConfig, robot: Robot, task: Task, plans: tuple[AnyPlan, ...], n_boxes: int
) -> None:
    """Search grasps in one model alone and by races in perturbed ones; judge both by others."""
    judge = RobustnessConfig(models=N_JUDGES, seed=JUDGE)
    for what, robust in (("in one model", None), ("by races", RobustConfig())):
        results = config.refine.model_copy(update={"robust": robust}).run(plans, robot, task)
        shares = [one.success.mean() for one in judge.run(results, robot, task)]
        show(
            f"searched {what}: episodes; held in {N_JUDGES} other models",
            f"{' '.join(str(int(one.simulations.sum())) for one in results)}; "
            f"{' '.join(f'{share:.2f}' for share in shares)}",
        )
        measure_boxes(robot, task, results, n_boxes)


def measure_longer_pulls(
    config: PipelineConfig, robot: Robot, task: Task, motions: tuple[RefinedMotion, ...]
) -> None:
    """Learn to pull farther than was shown, and a shorter lever than was shown."""
    for what, lever in (
        ("90 degrees", {"pull_deg": 90.0}),
        ("lever of 0.18 m", {"length_m": 0.18}),
    ):
        other = changed(task, lever=lever)
        plans = tuple(motion.plan for motion in motions)
        results = config.refine.run(plans, robot, other)
        before = sum(not np.isnan(one.misses[0]) and one.misses[0] <= 0.02 for one in results)
        plans, finer = [one.plan for one in results], finer_task(other)
        # As refinement does, and where the arm has to follow as closely as at the usual step.
        lenient, strict = (
            sum(trial.success for trial in try_plans(robot, one, plans))
            for one in (lenient_task(finer), finer)
        )
        show(
            f"other than shown: {what}",
            f"{before} of {len(results)} at once, {sum(one.success for one in results)} learnt "
            f"(at dt/4 {lenient}; arm near its way {strict}), "
            f"{np.median([len(one.returns) for one in results]):.0f} episodes",
            "150",
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", help=", ".join(RECIPES))
    parser.add_argument("--boxes", type=int, default=N_BOXES, help="places of the box to grasp")
    arguments = parser.parse_args()
    print(f"load of the machine {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.tasks or RECIPES:
            config, motions, wall = refined(name, Path(folder))
            robot, task = load_robot(config.robot, config.tool), load_task(config.task)
            print(f"{name}, {robot.name}")
            episodes = [len(motion.returns) for motion in motions]
            first = [motion.failure or "-" for motion in motions]
            show("imitated only", ", ".join(f"{n} {k}" for k, n in Counter(first).items()))
            show(
                "succeed after refinement",
                f"{sum(motion.success for motion in motions)} of {len(motions)}, {wall:.1f} s",
            )
            show(
                "episodes, with a margin of half",
                f"{np.median(episodes):.0f} median, {max(episodes)} most",
            )
            show("episodes to the criterion itself", first_success(motions, task))
            measure_throughput(robot, task, motions[0])
            measure_step(robot, task, motions)
            if name == "grasp_box":
                alone = changed(task, box={"spread_m": 0.0})
                show("with the box in one place alone:", "")
                measure_throughput(robot, alone, motions[0])
                measure_races(config, robot, task, imitated(name, Path(folder)), arguments.boxes)
            if name == "pull_lever":
                measure_longer_pulls(config, robot, task, motions)


if __name__ == "__main__":
    main()
