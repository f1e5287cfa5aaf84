"""Refinement block by block beside one search over the whole sequence, and one from scratch.

Run with ``python benchmarks/block_refinement.py [FOLDER [ROBOT [TASKS [BUDGET [METHODS]]]]]``, the
folder with the public pick-and-place recordings; without one, or with ``synthetic``, on synthetic
ones. It prints of each task what ``besman evaluate refinement --problem rearrange`` sums up; see
`besman.evaluation.whole_task_problem.WholeTaskProblem` for what the three are. A fourth, ``told``,
is as one after an episode as it was shown has told how the box hangs in the hand: what block by
block knows within each. METHODS are some of these, with commas between them.

A try that is out of reach counts as an episode, too; BUDGET is how many at most, shared evenly by
the parts. In the end the whole task that was found is simulated at once and judged as any other
(`rearrange`).
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from whole_tasks import ACTIONS, find_actions, imitate_tasks

from besman.evaluation.whole_task_problem import whole_task_problem
from besman.exceptions import PlanError
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_whole_task
from besman.stages.refine.block_detours import lead_parts_around
from besman.stages.refine.block_parts import n_parameters, shape_part, split_task
from besman.synthetic.datasets import write_synthetic


def search(problem, plan, name, seed):
    """Return what a search has come to, and how many episodes were before it."""
    if name != "told":
        return problem.search(plan, name, seed), 0
    parts, trials = problem.divide(plan, "as_one")
    shown = replace(problem, episodes=1).search_parts(parts, trials, "as_one", seed)
    if shown.success:
        return shown, 0
    way = problem.task.grasp_way(problem.frame)
    try:
        take = shape_part(parts[0], way, problem.robot, np.zeros(n_parameters("take")), None)
    except PlanError:
        return problem.search_parts(parts, trials, "as_one", seed), 0
    taken = trials.attempt(take, trials.first(take.blocks[0].start), "take")
    if not taken.success:
        return problem.search_parts(parts, trials, "as_one", seed), 0
    take, put, *rest = split_task(plan)
    told = (take, put._replace(tool=trials.tool_at_place(taken.end)), *rest)
    led = lead_parts_around(told, way, trials)
    return problem.search_parts(led, trials, "as_one", seed), 1


def compare(plans, robot, n_tasks, budget, methods):
    """Refine tasks in several ways; print what each has come to."""
    task = load_whole_task("rearrange")
    problem = whole_task_problem("rearrange", tuple(plans), robot, task, budget)
    rows = np.unique(np.linspace(0, len(problem.plans) - 1, n_tasks).astype(int))
    names = methods or (*problem.methods, "told")
    told = {name: [] for name in names}
    for number, plan in enumerate(problem.plans[k] for k in rows):
        for name in names:
            began = time.process_time()
            found, before = search(problem, plan, name, number)
            seconds = time.process_time() - began
            success, said = False, "does not come to its end"
            if found.plan is not None:
                (trial,) = task.try_tasks([found.plan], robot, problem.frame)
                success, said = trial.success, trial.failure or "beside its place"
            told[name].append((found, sum(found.episodes.values()) + before, success, seconds))
            episodes = ", ".join(f"{part} {n}" for part, n in found.episodes.items())
            print(
                f"{plan.name}, {name}: {episodes}; CPU {seconds:.0f} s; "
                f"{'succeeds' if success else said}",
                flush=True,
            )
    for name, runs in told.items():
        episodes = [n for _, n, _, _ in runs]
        simulated = [found.simulated_s for found, *_ in runs]
        print(
            f"{robot.name}, {name}: {sum(success for _, _, success, _ in runs)} of {len(runs)} "
            f"succeed; episodes: median {np.median(episodes):.0f}, sum {sum(episodes)}; simulated "
            f"seconds: median {np.median(simulated):.0f}, sum {sum(simulated):.0f}; CPU seconds: "
            f"median {np.median([s for *_, s in runs]):.0f}, sum {sum(s for *_, s in runs):.0f}",
            flush=True,
        )


def main(folder, robot="iiwa7", n_tasks=6, budget=300, methods=""):
    found, arm = find_actions(folder), load_robot(robot, "gripper3")
    asked = tuple(name for name in methods.split(",") if name)
    for name in ACTIONS:
        print(f"{name}:", flush=True)
        plans, *_ = imitate_tasks(arm, found[name])
        compare(plans, arm, int(n_tasks), int(budget), asked)


if __name__ == "__main__":
    if len(sys.argv) > 1 and sys.argv[1] != "synthetic":
        main(Path(sys.argv[1]), *sys.argv[2:])
    else:
        with tempfile.TemporaryDirectory() as made:
            print("synthetic: 2 subjects, 3 recordings each")
            write_synthetic("pick_and_place", Path(made), 2, 3)
            main(Path(made), *sys.argv[2:])
