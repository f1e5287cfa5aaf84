"""Refinement block by block beside one search over the whole sequence, and one from scratch.

Run with ``python benchmarks/block_refinement.py [FOLDER [ROBOT [TASKS [BUDGET]]]]``, the folder
with the public pick-and-place recordings; without one on synthetic ones. Every task begins as the
person has shown it: the tool is where the hand was in the frame of the box and of its place, with
straight ways of the task's own lengths. What a search may change are these two poses, how much
higher the arm goes, how far it leaves, and how slow the last part is: 15 numbers.

- block by block: CMA-ES on the numbers of one part, on the reward of that part, until it succeeds;
  the next begins in the state of the simulation in which that has ended.
- as one: CMA-ES on all numbers, on the sum of the same rewards, each episode the whole task.
- from scratch: the same without what was shown, with a first step that is five times as large:
  blocks without a shape, and a tool square to the frame of the box's markers, in its origin.

All three count every try as an episode, also those that are out of reach; BUDGET is how many at
most, shared evenly by the parts. In the end the whole task that was found is simulated at once and
judged as any other (`rearrange`).
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from whole_tasks import ACTIONS, find_actions, imitate_tasks

from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_whole_task
from besman.simulation.tasks.rearrange.block_trials import BlockTrials
from besman.stages.refine.block_parts import split_task
from besman.stages.refine.block_search import search_blocks, search_whole
from besman.synthetic.datasets import write_synthetic

SIGMA, SCRATCH = 1.0, 5.0


def compare(plans, robot, n_tasks, budget):
    """Refine tasks in three ways; print what each has come to."""
    task = load_whole_task("rearrange")
    frame = task.box_frame(plans, robot)
    way = task.grasp_way(frame)
    chosen = [plans[k] for k in np.unique(np.linspace(0, len(plans) - 1, n_tasks).astype(int))]
    told = {"block by block": [], "as one": [], "from scratch": []}
    for number, plan in enumerate(chosen):
        trials = BlockTrials.of(plan, robot, task, frame, 0)
        shown, bare = split_task(plan), split_task(plan, scratch=True)
        runs = {
            "block by block": (search_blocks, shown, budget // len(shown), SIGMA),
            "as one": (search_whole, shown, budget, SIGMA),
            "from scratch": (search_whole, bare, budget, SCRATCH),
        }
        for name, (search, parts, most, sigma) in runs.items():
            began = time.process_time()
            found = search(parts, way, trials, most, number, sigma)
            seconds = time.process_time() - began
            success, said = False, "does not come to its end"
            if found.plan is not None:
                (trial,) = task.try_tasks([found.plan], robot, frame)
                success, said = trial.success, trial.failure or "beside its place"
            told[name].append((found, success, seconds))
            episodes = ", ".join(f"{part} {n}" for part, n in found.episodes.items())
            print(
                f"{plan.name}, {name}: {episodes}; CPU {seconds:.0f} s; "
                f"{'succeeds' if success else said}",
                flush=True,
            )
    for name, runs in told.items():
        episodes = [sum(found.episodes.values()) for found, _, _ in runs]
        simulated = [found.simulated_s for found, _, _ in runs]
        print(
            f"{robot.name}, {name}: {sum(success for _, success, _ in runs)} of {len(runs)} "
            f"succeed; episodes: median {np.median(episodes):.0f}, sum {sum(episodes)}; simulated "
            f"seconds: median {np.median(simulated):.0f}, sum {sum(simulated):.0f}; CPU seconds: "
            f"median {np.median([s for *_, s in runs]):.0f}, sum {sum(s for *_, s in runs):.0f}"
        )


def main(folder, robot="iiwa7", n_tasks=6, budget=300):
    found, arm = find_actions(folder), load_robot(robot, "gripper3")
    for name in ACTIONS:
        print(f"{name}:", flush=True)
        plans, *_ = imitate_tasks(arm, found[name])
        compare(plans, arm, int(n_tasks), int(budget))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]), *sys.argv[2:])
    else:
        with tempfile.TemporaryDirectory() as made:
            print("synthetic: 2 subjects, 3 recordings each")
            write_synthetic("pick_and_place", Path(made), 2, 3)
            main(Path(made))
