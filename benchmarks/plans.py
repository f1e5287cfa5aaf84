"""New goals for blocks that were learnt: places and orders that nobody has shown.

Run with ``python benchmarks/plans.py [FOLDER [ROBOT [GOALS [SEED]]]]``, the folder with the public
pick-and-place recordings, or a finished run of whole tasks; without one on the embedded recordings
(synthetic). Both actions are learnt, and 20 goals (or as many, drawn by a seed) planned: as they
are, and with other ways where that fails.

Five kinds of goals take turns, each with its own draw of places: to another place, there and back,
there and on to a second place of the same kind, to another place where it stands (an order of
blocks that nobody has shown), and two boxes. A place is drawn within 20 cm of a shown one, 3 cm
from all of them at least, 25 cm from other places of the goal; it is drawn again if the arm cannot
have the gripper there, where its straight ways begin and end, by inverse kinematics of each of
these poses alone: the planner has no part in it.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from besman.config.resources import find_resource
from besman.exceptions import PlanError
from besman.motion.adapt_task import frame_matrix
from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.pipeline.retarget import retarget_pipeline
from besman.planning.goals import parse_goals, parse_start
from besman.planning.learnt import read_learnt
from besman.planning.planned_run import plan_goals, plan_run
from besman.robot.inverse_kinematics import solve_path

N_GOALS, SEED = 20, 0
REACH_M, NEW_M, APART_M = 0.2, 0.03, 0.25
MOST_DRAWS = 1000
BOTH = "select.action=[to_table,to_shelf]"


def learn(folder, robot, into):
    """Run a recipe on recordings."""
    settings = [BOTH]
    if folder is not None:
        settings += [f"recordings={folder}", "label.learn_from=null"]
    config = load_pipeline(find_resource("pipelines", f"{robot}_pick_and_place"), tuple(settings))
    return run_pipeline(config, into, jobs=2)


def within_reach(learnt, xy, shown):
    """Tell whether the gripper can be at a place, and where its ways there begin and end."""
    bench = learnt.bench
    way = bench.task.grasp_way(bench.frame)
    turned = np.arctan2(xy[1], xy[0]) - np.arctan2(shown[1], shown[0])
    heading = 2 * np.arctan2(shown[6], shown[3])
    for angle in (heading, heading + turned):
        pose = np.array([*xy, shown[2], np.cos(angle / 2), 0, 0, np.sin(angle / 2)])
        box = frame_matrix(pose) @ np.linalg.inv(bench.frame.matrix)
        ends = (way.tool, way.back(way.before_m), way.back(way.after_m), way.above)
        found = [solve_path(bench.robot, (box @ end)[None]) for end in ends]
        if all(one.position_error[0] < 1e-3 and one.orientation_error[0] < 0.01 for one in found):
            return True
    return False


def draw(learnt, place, others, rng):
    """Draw a place that nobody has shown."""
    known = learnt.places[place].poses
    for _ in range(MOST_DRAWS):
        near = known[rng.integers(len(known))]
        angle, away = rng.uniform(0, 2 * np.pi), REACH_M * np.sqrt(rng.uniform())
        xy = np.round(near[:2] + away * np.array([np.cos(angle), np.sin(angle)]), 3)
        new = np.linalg.norm(known[:, :2] - xy, axis=1).min() >= NEW_M
        beside = all(np.hypot(*(xy - one)) >= APART_M for one in others)
        if new and beside and within_reach(learnt, xy, known[0]):
            return xy
    raise SystemExit(f"no new place at {learnt.places[place].name} within reach")


def draw_goal(number, learnt, rng):
    """Return start and goal as a user would type them."""
    here = learnt.first[1]
    there = 1 - here
    names = [place.name for place in learnt.places]

    def at(place, xy):
        return f"{names[place]} at x={xy[0]:g},y={xy[1]:g}"

    kind = number % 5
    if kind == 3:
        return "", f"box1 on {at(here, draw(learnt, here, [], rng))}"
    one = draw(learnt, there, [], rng)
    if kind == 0:
        return "", f"box1 on {at(there, one)}"
    if kind == 1:
        return "", f"box1 on {at(there, one)}; box1 on {at(here, draw(learnt, here, [], rng))}"
    two = draw(learnt, there, [one], rng)
    if kind == 2:
        return "", f"box1 on {at(there, one)}; box1 on {at(there, two)}"
    three = draw(learnt, here, [], rng)
    start = f"box1 on {names[here]}; box2 on {at(there, one)}"
    return start, f"box1 on {at(there, two)}; box2 on {at(here, three)}"


def try_goals(learnt, n_goals, seed):
    """Plan all goals, without and with other ways; print what comes of each."""
    rng = np.random.default_rng(seed)
    drawn = [draw_goal(number, learnt, rng) for number in range(n_goals)]
    counts, seconds, misses = [0, 0], [], []
    for number, (start, goal) in enumerate(drawn, 1):
        said = []
        for refine in (False, True):
            began = time.process_time()
            try:
                standing = parse_start(start) if start else ()
                made = plan_goals("plan", parse_goals(goal), standing, learnt, refine)
            except PlanError as error:
                said.append(f"none: {error}")
                continue
            counts[refine] += made.success
            failed = [leg.trial.failure or "beside" for leg in made.legs if not leg.trial.success]
            tries = "+".join(str(leg.tries) for leg in made.legs)
            said.append("yes" if made.success else f"no: {failed[0]}")
            if refine:
                seconds.append(time.process_time() - began)
                said.append(f"{tries} ways, {made.plan.duration:.0f} s, CPU {seconds[-1]:.1f} s")
                misses += [1e3 * leg.trial.miss for leg in made.legs if made.success]
            elif made.success:
                said.append("the same")
                seconds.append(time.process_time() - began)
                misses += [1e3 * leg.trial.miss for leg in made.legs]
                counts[True] += 1
                break
        print(f"{number:2} {start + ' | ' if start else ''}{goal}: {', '.join(said)}", flush=True)
    print(
        f"{learnt.bench.robot.name}: {counts[0]} of {n_goals} succeed as they are, {counts[1]} "
        f"with other ways; {np.median(misses):.1f} mm off in the median, {max(misses):.1f} at "
        f"most; CPU {np.median(seconds):.1f} s a goal in the median, {max(seconds):.1f} at most"
    )


def time_one(run, recording, into):
    """Time the way from one recording to an exported plan, after training."""
    began = time.perf_counter(), time.process_time()
    config = retarget_pipeline(run, [recording])
    run_pipeline(config, into, trained_in=run)
    mapped = time.perf_counter(), time.process_time()
    _, learnt = read_learnt(into)
    names = [place.name for place in learnt.places]
    goal = f"box1 on {names[1 - learnt.first[1]]}"
    plan_run(into, parse_goals(goal))
    done = time.perf_counter(), time.process_time()
    print(
        f"from one recording to exported tasks: {mapped[0] - began[0]:.1f} s (CPU "
        f"{mapped[1] - began[1]:.1f} s), and on to an exported plan {done[0] - mapped[0]:.1f} s "
        f"(CPU {done[1] - mapped[1]:.1f} s)"
    )


def main(folder=None, robot="iiwa7", n_goals=N_GOALS, seed=SEED):
    with tempfile.TemporaryDirectory() as made:
        if folder is not None and (Path(folder) / "run.json").exists():
            run = Path(folder)
        else:
            print("synthetic: the embedded recordings" if folder is None else "real", flush=True)
            run = learn(folder, robot, Path(made) / "run")
        _, learnt = read_learnt(run)
        for block in learnt.blocks:
            print(f"learnt: {block.label}, {block.frame}, from {len(block.uses)} demonstrations")
        try_goals(learnt, int(n_goals), int(seed))
        recording = Path(load_pipeline(run / "pipeline.yaml", ()).recordings[0])
        if recording.is_dir():
            recording = sorted(recording.glob("*.tsv"))[0]
        time_one(run, recording, Path(made) / "one")


if __name__ == "__main__":
    main(*sys.argv[1:])
