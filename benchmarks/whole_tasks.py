"""Whole tasks: real actions as sequences of blocks, and when the box is grasped and released.

Run with ``python benchmarks/whole_tasks.py FOLDER [ROBOT...]``, the folder with the public
pick-and-place recordings; for each robot all actions are mapped, imitated block by block, simulated
(`rearrange`) and refined, too.
Blocks are found by the default segmentation and recognition, examples drawn as in a run; what is
right is what a person named. The box's own motion is told from the box alone: it moves while its
speed, of positions smoothed over a tenth of a second, is above 2 cm/s. Without a folder it looks at
synthetic recordings.
"""

import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from besman.evaluation.recognition_data import bridge_gaps, name_parts
from besman.motion.task_rollout import sample_task
from besman.person.marker_set import load_marker_set
from besman.records.layers import drop_parts
from besman.robot.limits import check_limits
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_whole_task
from besman.stages.imitate.stage import ImitateConfig
from besman.stages.imitate.task_plans import ImitateTasks
from besman.stages.map.stage import MapConfig
from besman.stages.map.whole_tasks import MapAmongBoards, MapTasks
from besman.stages.read.read_inputs import read_inputs
from besman.stages.recognize.stage import RecognizeConfig
from besman.stages.refine.stage import CmaEsConfig
from besman.stages.refine.whole_tasks import AimTasks, RefineTasks, SimulateTasks
from besman.stages.segment.methods import DefaultSegmentConfig
from besman.stages.select.block_steps import DivideActions, FindActions
from besman.stages.select.stage import SelectConfig
from besman.synthetic.datasets import write_synthetic
from besman.work.work import Notes, Work

ACTIONS = {
    "to_table": ("approach_forward", "move_obj_table", "move_to_rest_right"),
    "to_shelf": ("approach_right", "move_obj_shelf", "move_to_rest_down"),
}
SLOW_M_S = 0.02
SEEDS = 5


def true_actions(truth):
    """Rows of the actions that a person's blocks make, by their names."""
    whole = drop_parts(truth)
    order = [k for k in np.argsort(whole.bounds[:, 0]) if whole.labels[k] != "idle"]
    labels = [whole.labels[k] for k in order]
    found = []
    for name, sequence in ACTIONS.items():
        for k in range(len(labels) - len(sequence) + 1):
            if tuple(labels[k : k + len(sequence)]) == sequence:
                bounds = whole.bounds[order[k : k + len(sequence)]]
                found.append((name, bounds))
    return found


def own_motion(recording, markers, start, stop):
    """First and last row in which the box moves by itself, the longest stretch within rows."""
    path = np.mean([recording.marker(name) for name in markers], axis=0)
    n = max(1, round(0.1 * recording.rate_hz))
    smooth = np.stack([np.convolve(one, np.ones(n) / n, mode="same") for one in path.T], axis=1)
    speed = np.linalg.norm(np.gradient(smooth, axis=0), axis=1) * recording.rate_hz
    speed[:n] = speed[-n:] = 0.0
    moves = np.flatnonzero(np.diff(np.concatenate([[0], speed > SLOW_M_S, [0]])))
    runs = [(a, b) for a, b in moves.reshape(-1, 2) if a < stop and b > start]
    return max(runs, key=lambda run: run[1] - run[0])


def compare(found, actions, recordings, truth, box):
    """Offsets of borders, grasps and releases of the demonstrations that have the right blocks."""
    border_s, grasp_s, release_s, right = [], [], [], 0
    by_source = {own.source: k for k, own in enumerate(recordings)}
    for one in found:
        source, _, row = one.name.rpartition(":")
        at = by_source[source]
        start, stop = actions[at].bounds[int(row)]
        rate_hz = recordings[at].rate_hz
        for label, bounds in true_actions(truth[at]):
            shared = min(stop, bounds[-1, 1]) - max(start, bounds[0, 0])
            if one.hand.label != label or one.labels != ACTIONS[label]:
                continue
            if 2 * shared < bounds[-1, 1] - bounds[0, 0]:
                continue
            right += 1
            border_s += np.abs(one.bounds_s - (bounds - start) / rate_hz).ravel().tolist()
            moves = (np.array(own_motion(recordings[at], box, start, stop)) - start) / rate_hz
            if len(one.holds_s) == 1:
                grasp_s.append(float(one.holds_s[0, 0] - moves[0]))
                release_s.append(float(one.holds_s[0, 1] - moves[1]))
            else:
                print(f"{one.name}: {len(one.holds_s)} holds; expected 1")
    return right, border_s, grasp_s, release_s


def find_actions(folder, seed=0):
    """Find all actions in recordings as a run does; demonstrations by the action's name."""
    inputs = read_inputs([str(folder)])
    recordings = tuple(bridge_gaps(name_parts(one)) for one in inputs.recordings)
    truth = tuple(one for one in inputs.truth if one is not None)
    segments = DefaultSegmentConfig().run(recordings)
    recognize = RecognizeConfig(seed=seed)
    blocks = recognize.run(recordings, segments, recognize.train(recordings, truth))
    return {name: divide(name, recordings, blocks)[1] for name in ACTIONS}


def divide(name, recordings, blocks, work=None):
    """Return where actions of one name are, and their demonstrations."""
    config = SelectConfig(action=name, actions=ACTIONS, **{"as": "blocks"})
    actions = FindActions(config).run(recordings, blocks, ())
    hands = config.run(recordings, actions)
    markers = load_marker_set("right_arm")
    work = work or Work()
    return actions, DivideActions(config).run(recordings, blocks, actions, hands, markers, work)


def imitate_tasks(robot, demonstrations):
    """Map actions to an arm, and imitate them block by block; how long both took."""
    map_config = MapConfig(weights={"position": 5, "singularity": 5})
    work = Work(notes=Notes())
    started = time.perf_counter()
    task = load_whole_task("rearrange")
    mapping = MapAmongBoards(map_config).run(demonstrations, robot, task, work)
    tasks = MapTasks(map_config).run(mapping, demonstrations, robot)
    mapped = time.perf_counter()
    plans = ImitateTasks(ImitateConfig()).run(tasks, robot, work)
    seconds = mapped - started, time.perf_counter() - mapped
    return plans, tasks, (*mapping.failed, *work.notes.failures), seconds


def plan_tasks(robot_name, demonstrations, tool="gripper3"):
    """Map actions to an arm, imitate them block by block, and say how well."""
    robot = load_robot(robot_name, tool)
    plans, tasks, failures, (mapped_s, seconds) = imitate_tasks(robot, demonstrations)
    outside = 0
    slower, jumps = [], []
    by_name = {task.name: task for task in tasks}
    for plan in plans:
        _, q, v, a = sample_task(plan)
        report = check_limits(robot, q, v, a)
        outside += report.position + report.velocity + report.acceleration
        outside += report.torque + report.self_collisions
        mapped_s = by_name[plan.name].trajectory.time[-1] + 0.3
        slower.append(plan.duration / mapped_s)
        jumps.append(np.max(np.abs(np.diff(v, axis=0))) / (1e-3 * np.max(np.abs(a))))
    print(
        f"{robot_name}: {len(tasks)} of {len(demonstrations)} mapped "
        f"({mapped_s:.0f} s), {len(plans)} imitated block by block ({seconds:.1f} s); "
        f"root mean square error {max(plan.rmse for plan in plans):.4f} rad at most"
    )
    print(
        f"  samples at 1 kHz outside a limit or in self-collision: {outside}; duration over the "
        f"mapped one: median {np.median(slower):.2f}, max {max(slower):.2f}; greatest change of "
        f"velocity in a sample over the greatest acceleration's: {max(jumps):.2f}"
    )
    for failure in failures:
        print(f"  left out: {failure}")
    frames = Counter(tuple(b.frame for b in plan.blocks if b.label != "idle") for plan in plans)
    for found, n in frames.most_common():
        print(f"  goals relative to {', '.join(found)}: {n}")
    try_tasks(plans, robot)


def try_tasks(plans, robot):
    """Simulate tasks as they were imitated, then try other ways, and say how many succeed."""
    task, config = load_whole_task("rearrange"), CmaEsConfig()
    work = Work(notes=Notes())
    aimed = AimTasks(config).run(plans, robot, task, work)
    records = (aimed, plans, robot, task)
    trials = SimulateTasks(config).run(*records, work)
    print(f"  simulated: {sum(one.success for one in trials)} of {len(plans)} succeed as imitated")
    for failure in work.notes.failures:
        print(f"    out of reach: {failure}")
    for one in trials:
        if not one.success:
            print(f"    {one.name}: {one.failure or 'beside its place'}, {1e3 * one.miss:.0f} mm")
    started = time.perf_counter()
    work = Work(notes=Notes())
    refined = RefineTasks(config).run(aimed, trials, plans, robot, task, work)
    good = [one for one in refined if one.trial.success]
    misses = [1e3 * one.trial.miss for one in good] or [np.nan]
    tries = [one.tries for one in refined]
    print(
        f"  refined: {len(good)} of {len(plans)}, {np.median(misses):.1f} mm off in the median, "
        f"{max(misses):.1f} at most; ways tried: median {np.median(tries)}, max {max(tries)}; "
        f"{time.perf_counter() - started:.0f} s"
    )
    for failure in work.notes.failures:
        print(f"    left out: {failure}")
    for one in refined:
        if not one.trial.success:
            print(f"    {one.plan.name}: {one.trial.failure or 'beside its place'}")


def main(folder, robots=()):
    inputs = read_inputs([str(folder)])
    recordings = tuple(bridge_gaps(name_parts(one)) for one in inputs.recordings)
    truth = tuple(one for one in inputs.truth if one is not None)
    segments = DefaultSegmentConfig().run(recordings)
    markers = load_marker_set("right_arm")
    n_true = sum(len(true_actions(one)) for one in truth)
    rights, figures, first = [], ([], [], []), {}
    for seed in range(SEEDS):
        recognize = RecognizeConfig(seed=seed)
        blocks = recognize.run(recordings, segments, recognize.train(recordings, truth))
        rights.append(0)
        for name in ACTIONS:
            actions, found = divide(name, recordings, blocks)
            first.setdefault(name, found)
            right, *offsets = compare(found, actions, recordings, truth, markers.objects["box"])
            rights[-1] += right
            for own, new in zip(figures, offsets, strict=True):
                own += new
    print(f"actions with the right blocks in the right order, of {n_true}, for {SEEDS} draws of")
    print(f"examples: {', '.join(map(str, rights))} ({sum(rights) / n_true / SEEDS:.1%})")
    print(
        f"borders of their blocks: median off {np.median(figures[0]):.3f} s, "
        f"95 % {np.percentile(figures[0], 95):.3f} s"
    )
    for what, off in zip(("grasp", "release"), figures[1:], strict=True):
        away = np.abs(off)
        print(
            f"{what} against the box's own motion: median {np.median(away):.3f} s "
            f"(signed {np.median(off):+.3f}), within 0.15 s {np.mean(away <= 0.15):.0%}, "
            f"worst {away.max():.3f} s"
        )

    for robot in robots:
        for name, found in first.items():
            print(name, end=", ")
            plan_tasks(robot, found)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]), sys.argv[2:])
    else:
        with tempfile.TemporaryDirectory() as made:
            print("synthetic: 2 subjects, 3 recordings each")
            write_synthetic("pick_and_place", Path(made), 2, 3)
            main(Path(made))
