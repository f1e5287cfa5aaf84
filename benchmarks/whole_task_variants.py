"""Whole tasks of recordings that were disturbed: another size, place, rate, and gaps.

Run with ``python benchmarks/whole_task_variants.py FOLDER [ROBOT [EVERY [ONLY]]]``, the folder with
the public pick-and-place recordings; ONLY is part of the name of a disturbance. All of them are
disturbed alike; blocks are found by the default segmentation and recognition, examples drawn from
them, and of each action every fourth (EVERY) demonstration is mapped, imitated, and simulated
(`rearrange`) as it was imitated, then refined.
"""

import dataclasses
import sys
from pathlib import Path

import numpy as np
from whole_tasks import ACTIONS, divide, imitate_tasks

from besman.evaluation.recognition_data import bridge_gaps, name_parts
from besman.exceptions import BesmanError
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_whole_task
from besman.stages.read.read_inputs import read_inputs
from besman.stages.recognize.stage import RecognizeConfig
from besman.stages.refine.stage import CmaEsConfig
from besman.stages.refine.whole_tasks import AimTasks, RefineTasks, SimulateTasks
from besman.stages.segment.methods import DefaultSegmentConfig
from besman.work.work import Notes, Work


def move(recording, scale=1.0, yaw_deg=0.0, shift=(0.0, 0.0, 0.0)):
    """Make a recording smaller or larger, turn it about the vertical, and shift it."""
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])
    positions = scale * recording.positions @ turn.T + shift
    return dataclasses.replace(recording, positions=positions)


def resample(recording, truth, rate_hz):
    """Interpolate a recording at another rate, and bring its segments along."""
    n = int((len(recording.time) - 1) * rate_hz / recording.rate_hz) + 1
    time = np.arange(n) / rate_hz
    flat = recording.positions.reshape(len(recording.time), -1)
    own = np.arange(len(recording.time)) / recording.rate_hz
    columns = np.stack([np.interp(time, own, column) for column in flat.T], axis=1)
    moved = dataclasses.replace(
        recording,
        time=time,
        positions=columns.reshape(n, *recording.positions.shape[1:]),
        rate_hz=rate_hz,
        filled=np.zeros((n, recording.positions.shape[1]), dtype=bool),
    )
    bounds = np.minimum(np.round(truth.bounds * rate_hz / recording.rate_hz).astype(int), n)
    return moved, dataclasses.replace(truth, bounds=bounds, rate_hz=rate_hz)


def hide(recording, rng, prefix="box", gap_s=0.3, every_s=3.0):
    """Hide each marker of the box for a while, at random times."""
    positions = np.array(recording.positions)
    length, n = round(gap_s * recording.rate_hz), len(positions)
    for column, name in enumerate(recording.markers):
        if name.startswith(prefix):
            for start in rng.integers(length, n - 2 * length, int(n / recording.rate_hz / every_s)):
                positions[start : start + length, column] = np.nan
    return dataclasses.replace(recording, positions=positions)


def disturb(recordings, truth):
    """Return recordings and segments by what was done to them."""
    rng = np.random.default_rng(0)
    resampled = [resample(*pair, 200.0) for pair in zip(recordings, truth, strict=True)]
    turned = [move(one, 1.0, 120.0, (2.0, -1.0, 0.0)) for one in recordings]
    return {
        "as they are": (recordings, truth),
        "nine tenths as large": ([move(one, 0.9) for one in recordings], truth),
        "eleven tenths as large": ([move(one, 1.1) for one in recordings], truth),
        "turned by 120 degrees, 2 m away": (turned, truth),
        "at 200 Hz": tuple(zip(*resampled, strict=True)),
        "a box's markers hidden for 0.3 s, every 3 s": ([hide(o, rng) for o in recordings], truth),
    }


def try_variant(recordings, truth, robot, every):
    """Return how many actions were found, mapped, and succeed as imitated and refined."""
    recordings = tuple(bridge_gaps(one) for one in recordings)
    segments = DefaultSegmentConfig().run(recordings)
    recognize = RecognizeConfig(seed=0)
    blocks = recognize.run(recordings, segments, recognize.train(recordings, tuple(truth)))
    counts, lines = np.zeros(5, dtype=int), []
    for name in ACTIONS:
        try:
            notes = Notes()
            _, found = divide(name, recordings, blocks, Work(notes=notes))
            lines += [str(one) for one in notes.failures]
            counts[0] += len(found)
            chosen = found[::every]
            counts[1] += len(chosen)
            plans, _, failures, _ = imitate_tasks(robot, chosen)
            lines += [str(one) for one in failures]
            task, config, work = load_whole_task("rearrange"), CmaEsConfig(), Work(notes=Notes())
            aimed = AimTasks(config).run(plans, robot, task, work)
            trials = SimulateTasks(config).run(aimed, plans, robot, task, work)
            refined = RefineTasks(config).run(aimed, trials, plans, robot, task, work)
        except BesmanError as error:
            lines.append(f"{name}: {error}")
            continue
        own = (len(plans), sum(t.success for t in trials), sum(r.trial.success for r in refined))
        counts[2:] += own
    return counts, lines


def main(folder, robot="ur5", every=4, only=""):
    inputs = read_inputs([str(folder)])
    recordings = [name_parts(one) for one in inputs.recordings]
    truth = [one for one in inputs.truth if one is not None]
    arm = load_robot(robot, "gripper3")
    for name, (own, labels) in disturb(recordings, truth).items():
        if only not in name:
            continue
        (found, tried, mapped, shown, refined), lines = try_variant(own, labels, arm, int(every))
        print(
            f"{robot}, {name}: {found} actions found, {tried} tried, {mapped} mapped; "
            f"{shown} succeed as imitated, {refined} refined",
            flush=True,
        )
        for line in lines:
            print(f"    {line}", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
