"""What `besman identify` finds of arms whose drives are known, from a few of their executions.

    python benchmarks/identify.py RUN                      # any finished run; MuJoCo as the arm
    python benchmarks/identify.py RUN --engine drake       # Drake as the arm (extra `verify`)
    python benchmarks/identify.py RUN --throws             # and what a throw gains by it

Executions are synthetic: the arm with its tool follows the set-points of the run's motions in a
perturbed model, as `besman robustness` draws them, or in Drake with such drives; joint angles are
logged at 250 Hz with noise of 0.1 mrad. In MuJoCo the masses of links are off as well, which no
quantity says; with --real so are backlash and noise, as in `transferability.py`. Paths are compared
in motions that were not logged too.

With --throws every arm throws the first motion, its log tells its drives, and `transfer suggest`
goes on with them; the thrown thing, its friction and mass stay unknown.
"""

import argparse
import os
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import transferability

from besman.pipeline.finished_run import read_run
from besman.robot.drives import arrive_late
from besman.simulation.arm_alone import arm_model, follow_setpoints
from besman.simulation.perturbation import Spreads, draw_perturbation
from besman.simulation.physics import run_physics
from besman.stages.refine.plan_space import plan_space
from besman.transfer.approach import RealTry, TransferConfig
from besman.transfer.archive import Simulator, no_plans
from besman.transfer.calibration import calibrated, landings_of
from besman.transfer.identification.executions import as_movement
from besman.transfer.identification.fit import ArmLog, fit_drives, sent_setpoints
from besman.transfer.identification.quantities import drives_with, values_of
from besman.transfer.newton import suggest_next
from besman.transfer.second_simulation import REAL_SPREADS
from besman.transfer.tries import PARTS

STEP_S, EVERY, NOISE_RAD, RADIUS_M = 0.002, 2, 1e-4, 0.10
# Of `besman.simulation.perturbation`: within this time an offset is taken up.
RAMP_S = 0.1


def drives_of_world(robot, world):
    return replace(
        robot.drives, gains=world.servo_gains, delays=world.delays, lags=world.lags,
        friction=world.joint_friction, damping=world.joint_damping,
    )  # fmt: skip


def in_mujoco(robot, world, movements):
    """Return joint paths (B, T, n) in a perturbed model."""
    setpoints = sent_setpoints(robot, movements)
    starts = np.stack([one.positions[0] for one in movements])
    run = run_physics(
        arm_model(robot, STEP_S), starts, setpoints,
        lambda *_: np.zeros(len(starts), dtype=bool), (world,) * len(starts),
    )  # fmt: skip
    time = STEP_S * np.arange(setpoints.shape[1])[:, None]
    # A controller reads its joints by its own zeros.
    zeros = world.offsets * (0.5 - 0.5 * np.cos(np.pi * np.minimum(time / RAMP_S, 1.0)))
    return np.concatenate([starts[:, None], run.qpos[:, :-1]], axis=1) - zeros


def in_drake(robot, world, movements):
    """Return the same in Drake, for the drives of the world."""
    from besman.simulation.second_engine.drake_run import run_drake
    from besman.simulation.second_engine.drake_scene import DrakeScene

    arm = replace(robot, drives=drives_of_world(robot, world))
    setpoints = arrive_late(sent_setpoints(robot, movements), arm.drives, STEP_S)
    paths = []
    for movement, sent in zip(movements, setpoints, strict=True):
        scene = DrakeScene(arm, STEP_S, 0.1)
        scene.finish()

        def look(context, scene=scene):
            state = scene.plant.GetPositions(context, scene.arm)
            return state, scene.plant.GetVelocities(context, scene.arm), np.empty(0)

        start = movement.positions[0]
        run = run_drake(scene, start, sent, lambda *_: np.zeros(1, dtype=bool), look)
        paths.append(np.concatenate([start[None], run.qpos[0, :-1]]))
    return np.stack(paths)


ARMS = {"mujoco": in_mujoco, "drake": in_drake}


def log_of(row, path, seed):
    """Return what a controller logs of a path (T, n)."""
    random = np.random.default_rng((seed, row))
    angles = path[::EVERY] + NOISE_RAD * random.standard_normal(path[::EVERY].shape)
    return ArmLog(row, STEP_S * EVERY * np.arange(len(angles)), angles, True)


def apart(robot, drives, movements, paths):
    """Return the root mean square of simulated minus true angles, rad."""
    late = arrive_late(sent_setpoints(robot, movements), drives, STEP_S)
    starts = np.stack([one.positions[0] for one in movements])
    simulated = follow_setpoints(replace(robot, drives=drives), starts, late, STEP_S)
    return float(np.sqrt(np.mean((simulated - paths[:, : simulated.shape[1]]) ** 2)))


def find_drives(robot, movements, paths, n_logs, seed, jobs):
    logs = [log_of(row, paths[row], seed) for row in range(n_logs)]
    return fit_drives(robot, movements[:n_logs], logs, jobs)


def recover(finished, given, spreads):
    """Print what is found of several arms."""
    robot = finished.robot
    movements = [as_movement(one) for one in finished.motions[: given.logs + given.others]]
    rows, seconds, paths_apart = {}, [], []
    for seed in range(given.first_seed, given.first_seed + given.arms):
        world = draw_perturbation(spreads, robot, (seed,))
        paths = ARMS[given.engine](robot, world, movements)
        start = time.process_time()
        fit = find_drives(robot, movements, paths, given.logs, seed, given.jobs)
        seconds.append(time.process_time() - start)
        truth = values_of(drives_of_world(robot, world), fit.quantities)
        for at, one in enumerate(fit.quantities):
            off = (fit.before[at] - truth[at], fit.found.values[at] - truth[at])
            told, sure = fit.found.told[at], fit.found.deviations[at]
            rows.setdefault(one.key, []).append((*np.abs(off), told, sure))
        others = slice(given.logs, None)
        paths_apart.append(
            [
                apart(robot, drives, movements[part], paths[part])
                for part in (slice(given.logs), others)
                for drives in (robot.drives, fit.drives)
            ]
        )
    print(
        f"{robot.name} in {given.engine}, {given.arms} arms, {given.logs} executions each, "
        f"{np.median(seconds):.0f} s of a core (median)"
    )
    print(
        "| quantity | told | error before, median | error, median | error, 90 % | within 2 s.d. |"
    )
    print("|---|---|---|---|---|---|")
    for key, values in rows.items():
        before, after, told, sure = np.array(values, dtype=float).T
        known = told > 0
        if not known.any():
            print(f"| {key} | 0 of {len(told)} | | | | |")
            continue
        within = np.mean(after[known] <= 2 * sure[known])
        print(
            f"| {key} | {known.sum()} of {len(told)} | {np.median(before[known]):.2g} | "
            f"{np.median(after[known]):.2g} | {np.quantile(after[known], 0.9):.2g} | {within:.0%} |"
        )
    logged = 1e3 * np.median(paths_apart, axis=0)
    print(
        f"paths apart, median of arms: logged motions {logged[0]:.2f} -> {logged[1]:.2f} mrad, "
        f"{given.others} others {logged[2]:.2f} -> {logged[3]:.2f} mrad"
    )


def count_tries(finished, given, seed, knows):
    """Return the misses of an arm's tries until one is within 10 cm."""
    motion, robot = finished.motions[given.motion], finished.robot
    config, target = TransferConfig(), motion.plan.target[:2]
    space = plan_space(motion.plan, robot, PARTS, config.n_shapes)
    arm = transferability.ARMS[given.engine](robot, finished.task, seed)
    simulator, archive, tries, misses = Simulator(space, robot, finished.task), None, [], []
    archive = no_plans(space.dimension)
    while len(misses) < given.most:
        model = calibrated(simulator, landings_of(space, archive, tries), given.jobs)
        choice = suggest_next(
            simulator, archive, tries, target, config, simulator.keeps_limits, given.jobs, model
        )
        archive = choice.archive
        outcome = arm.execute(space.plan_at(archive.points[choice.row]))
        tries.append(RealTry(choice.row, outcome))
        misses.append(float(np.nan_to_num(np.linalg.norm(outcome - target), nan=np.inf)))
        if misses[-1] <= RADIUS_M:
            break
        if knows and len(misses) == 1:
            world = draw_perturbation(REAL_SPREADS, robot, (seed,))
            movements = [as_movement(motion)]
            logged = ARMS[given.engine](robot, world, movements)
            fit = find_drives(robot, movements, logged, 1, seed, given.jobs)
            known = replace(
                robot, drives=drives_with(robot.drives, fit.quantities, fit.found.values)
            )
            simulator = Simulator(space, known, finished.task)
            archive = simulator.simulate(archive.points[[choice.row]], given.jobs)
            tries = [RealTry(0, outcome)]
    return misses


def throw(finished, given):
    """Print how many tries it takes, with what logs say of the drives and without."""
    print("| | first try, median | tries to 10 cm, median | most | tries of each |")
    print("|---|---|---|---|---|")
    kinds = (("landings alone", False), ("and the first try's log", True))
    for name, knows in kinds[int(given.log_only) :]:
        runs = [
            count_tries(finished, given, seed, knows)
            for seed in range(given.first_seed, given.first_seed + given.arms)
        ]
        tries = np.array([len(one) if one[-1] <= RADIUS_M else given.most + 1 for one in runs])
        first = np.median([one[0] for one in runs])
        print(
            f"| {name} | {100 * first:.0f} cm | {np.median(tries):g} | {tries.max()} | "
            f"{' '.join(map(str, tries))} |",
            flush=True,
        )
        for seed, misses in enumerate(runs if given.misses else (), given.first_seed):
            print(f"    arm {seed}: {' '.join(f'{one:.2f}' for one in misses)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, nargs="?", help="a finished run")
    parser.add_argument("--engine", choices=ARMS, default="mujoco")
    parser.add_argument("--arms", type=int, default=5)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--logs", type=int, default=4, help="executions that are logged")
    parser.add_argument("--others", type=int, default=4, help="motions that are not")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--real", action="store_true", help="arms as in transferability.py")
    parser.add_argument("--throws", action="store_true", help="tries until a throw lands near")
    parser.add_argument("--motion", type=int, default=0)
    parser.add_argument("--most", type=int, default=10, help="greatest number of tries")
    parser.add_argument("--log-only", action="store_true", help="of --throws: with the log alone")
    parser.add_argument("--misses", action="store_true", help="of every try, metres")
    given = parser.parse_args()
    if given.run is None:
        print("identification: of a finished run, name its RUN")
        return
    finished = read_run(given.run)
    if given.throws:
        throw(finished, given)
    else:
        recover(finished, given, REAL_SPREADS if given.real else Spreads())


if __name__ == "__main__":
    main()
