"""Real tries until a throw lands within 10 cm, where a second simulation is the real arm.

    python benchmarks/transferability.py                    # UR5 stick throw, embedded recordings
    python benchmarks/transferability.py --run RUN          # any finished run of a throw
    python benchmarks/transferability.py --engine drake     # such an arm in Drake, some 10 s a try
    python benchmarks/transferability.py --throws 16        # one throw after the other, same arm

The second simulation has other friction, masses, servo gains, delays, smoothing, backlash, zeros
and noise than the one that motions are searched in (`besman.transfer.second_simulation`); 10 seeds.
In Drake it has these as well, without other masses, backlash and zeros, and other contacts too.
Beside Newton steps and the transferability approach, with either surrogate, stand trying one
simulated success after another, and aiming beside the target by what the last try was off.
"""

import argparse
import os
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from besman.config.resources import find_resource
from besman.pipeline.config import load_pipeline
from besman.pipeline.finished_run import read_run
from besman.pipeline.pipeline import run_pipeline
from besman.simulation.perturbation import draw_perturbation
from besman.simulation.perturbed_trials import lenient_task
from besman.simulation.second_engine.engines import try_in_second_engine
from besman.stages.refine.plan_space import plan_space
from besman.stages.refine.stage import CmaEsConfig
from besman.transfer.approach import RealTry, TransferConfig
from besman.transfer.archive import Simulator, no_plans
from besman.transfer.calibration import calibrated, landings_of
from besman.transfer.newton import suggest_next as suggest
from besman.transfer.second_simulation import REAL_SPREADS, SecondSimulation
from besman.transfer.tries import PARTS

RADIUS_M = 0.10
NEWTON = "Newton steps in the model that landings tell (default)"
UNCALIBRATED = "Newton steps with the simulation's Jacobian as it is"
JOBS = os.cpu_count() or 1
GAUSS = "transferability approach, Gaussian process"
_EPISODES = 200


class DrakeArm:
    """An arm in Drake that differs from what is known of it as `SecondSimulation` does."""

    def __init__(self, robot, task, seed):
        world = draw_perturbation(REAL_SPREADS, robot, (seed,))
        drives = replace(
            robot.drives, gains=world.servo_gains, delays=world.delays, lags=world.lags,
            friction=world.joint_friction, damping=world.joint_damping,
        )  # fmt: skip
        self._robot = replace(robot, drives=drives)
        self._task = lenient_task(task)
        if task.kind == "stick_throw":
            self._task = with_friction(self._task, world.friction * task.holder.friction)

    def execute(self, plan):
        trial = try_in_second_engine(self._robot, self._task, plan)
        return np.where(trial.failure == "", trial.outcome[:2], np.nan)


def with_friction(task, friction):
    holder = task.holder.model_copy(update={"friction": friction})
    return task.model_copy(update={"holder": holder})


ARMS = {"mujoco": SecondSimulation, "drake": DrakeArm}


def approach(surrogate, motion, finished, calibrates=True):
    """Make a method of the transferability approach; its first search is the same for all arms."""
    config = TransferConfig(surrogate=surrogate)
    space = plan_space(motion.plan, finished.robot, PARTS, config.n_shapes)
    simulator = Simulator(space, finished.robot, finished.task)
    target = motion.plan.target[:2]
    may = simulator.keeps_limits
    first = suggest(simulator, no_plans(space.dimension), (), target, config, may, JOBS)

    def plans(known=None):
        """Give plans for what came of the ones before; `known` are landings, and gets new ones."""
        landings, tries, choice = [] if known is None else known, [], first
        if landings:
            model, none = calibrated(simulator, landings, JOBS), no_plans(space.dimension)
            choice = suggest(simulator, none, (), target, config, may, JOBS, model)
        while True:
            outcome = yield space.plan_at(choice.archive.points[choice.row])
            tries.append(RealTry(choice.row, outcome))
            archive, model = choice.archive, None
            landings += landings_of(space, archive, tries[-1:])
            if surrogate == "jacobian" and calibrates:
                model = calibrated(simulator, landings, JOBS)
            choice = suggest(simulator, archive, tries, target, config, may, JOBS, model)

    return plans, first, space


def throw_after_throw(finished, given):
    """Count the tries of every throw of an arm, each with what those before have told of it."""
    print("| arm | tries of its throws, one after the other | median | most |")
    print("|---|---|---|---|")
    motions = finished.motions[: given.throws]
    methods = [approach("jacobian", motion, finished)[0] for motion in motions]
    for shared in (True, False):
        counts = []
        for seed in range(given.first_seed, given.first_seed + given.seeds):
            arm, known, row = ARMS[given.engine](finished.robot, finished.task, seed), [], []
            for motion, plans in zip(motions, methods, strict=True):
                begin = partial(plans, known if shared else [])
                row.append(len(count_tries(begin, arm, motion.plan.target[:2], given.most)))
            counts += row
            of_arm = f"{np.median(row):g} | {max(row)}"
            print(f"| {seed} | {' '.join(map(str, row))} | {of_arm} |", flush=True)
        what = "what other throws told" if shared else "each alone"
        print(
            f"| all, {what} | mean {np.mean(counts):.2f} | {np.median(counts):g} | {max(counts)} |"
        )


def simulated_one_by_one(motion, first, space):
    """Try what is best in simulation, then the next best that behaves otherwise."""

    def plans():
        archive, seen = first.archive, []
        misses = np.linalg.norm(archive.outcomes - motion.plan.target[:2], axis=1)
        for row in np.argsort(np.nan_to_num(misses + archive.costs, nan=np.inf), kind="stable"):
            behaviour = archive.behaviours[row]
            if all(np.linalg.norm(behaviour - other) > 1.0 for other in seen):
                seen.append(behaviour)
                yield space.plan_at(archive.points[row])

    return plans


def local_correction(motion, finished):
    """Aim beside the target by what the last try was off, and refine for that in simulation."""
    task = finished.task
    if getattr(task, "target_m", None) is not None:  # Or it would aim there again.
        task = task.model_copy(update={"target_m": None})

    def plans():
        plan, aim = motion.plan, motion.plan.target.copy()
        while True:
            outcome = yield plan
            if np.isfinite(outcome).all():
                aim[:2] += motion.plan.target[:2] - outcome
            else:  # Nothing learnt: back half-way to where it was aimed first.
                aim = 0.5 * (aim + motion.plan.target)
            config = CmaEsConfig(episodes=_EPISODES, robustness=None)
            (found,) = config.run((replace(plan, target=aim),), finished.robot, task)
            plan = found.plan

    return plans


def count_tries(plans, arm, target, most):
    """Return the miss of every try until one is within the radius, infinite where it failed."""
    offers, outcome, misses = plans(), None, []
    while len(misses) < most:
        try:
            outcome = arm.execute(offers.send(outcome))
        except StopIteration:
            break
        misses.append(float(np.nan_to_num(np.linalg.norm(outcome - target), nan=np.inf)))
        if misses[-1] <= RADIUS_M:
            return misses
    return misses + [np.inf] * (most + 1 - len(misses))


def report(name, runs, seconds, most):
    tries = np.array([len(run) for run in runs])
    firsts = np.array([run[0] for run in runs])
    typical = f"{np.median(tries):g}" if np.median(tries) <= most else f"> {most}"
    print(
        f"| {name} | {100 * np.median(firsts):.0f} cm | {typical} | {np.mean(tries <= most):.0%} | "
        f"{np.mean(tries <= 10):.0%} | {seconds / len(runs):.1f} s |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--run", type=Path, help="a finished run of a throw")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=0, help="of the first arm")
    parser.add_argument("--motion", type=int, default=0)
    parser.add_argument("--most", type=int, default=20, help="greatest number of real tries")
    parser.add_argument("--only", nargs="+", default=[""], help="parts of names of methods")
    parser.add_argument("--engine", choices=ARMS, default="mujoco")
    parser.add_argument("--arms", action="store_true", help="the miss of every try, metres")
    parser.add_argument("--throws", type=int, default=0, help="so many motions, one by one")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if given.run is None:
            config = load_pipeline(
                find_resource("pipelines", "ur5_stick_throw"), ("refine.robustness=null",)
            )
            given.run = run_pipeline(config, Path(folder) / "run", jobs=JOBS)
        finished = read_run(given.run)
        if given.throws:
            throw_after_throw(finished, given)
            return
        motion = finished.motions[given.motion]
        methods = {
            NEWTON: lambda: approach("jacobian", motion, finished)[0],
            UNCALIBRATED: lambda: approach("jacobian", motion, finished, False)[0],
            GAUSS: lambda: approach("gaussian_process", motion, finished)[0],
            "transferability approach, inverse distance [1]": lambda: approach(
                "inverse_distance", motion, finished
            )[0],
            "simulated successes one by one": lambda: simulated_one_by_one(
                motion, *approach("gaussian_process", motion, finished)[1:]
            ),
            "aim beside the target by the last miss": lambda: local_correction(motion, finished),
        }
        print(f"{finished.labels[0]} {finished.labels[2]}, {motion.plan.name}, {given.seeds} arms")
        print("| method | first try | tries to 10 cm | ever | within 10 tries | time an arm |")
        print("|---|---|---|---|---|---|")
        chosen = {k: v for k, v in methods.items() if any(part in k for part in given.only)}
        for name, prepare in chosen.items():
            plans = prepare()
            start = time.perf_counter()
            runs = [
                count_tries(
                    plans,
                    ARMS[given.engine](finished.robot, finished.task, seed),
                    motion.plan.target[:2],
                    given.most,
                )
                for seed in range(given.first_seed, given.first_seed + given.seeds)
            ]
            report(name, runs, time.perf_counter() - start, given.most)
            for seed, misses in enumerate(runs if given.arms else (), given.first_seed):
                tried = " ".join("failed" if np.isinf(one) else f"{one:.2f}" for one in misses)
                print(f"    arm {seed}: {tried}")


if __name__ == "__main__":
    main()
