"""How hard a stick's contacts should begin: how smooth landings are, and how true.

    python benchmarks/contacts.py [RUN ...] [--solver | --parts]

Takes the refined throws of finished runs of sticks (`besman run ur5_stick_throw`, which is made if
none is named; *synthetic*) and simulates them with contacts that harden otherwise (MuJoCo's solimp:
impedance at first touch, impedance at a depth, that depth):

- roughness: along a random direction of goal and duration, 9 places 0.1 units apart, what is left
  of the landing's square polynomial, root mean square in radii of success, median and most of all;
- shift: how far it lands elsewhere at a quarter of the step, with contacts as much stiffer;
- error: how far from where it lands with the hard contacts of before and a sixteenth of the step;
- the processor time of an episode.

``--parts`` tells instead what of the shift at a quarter of the step is the step's and what is that
of contacts that are as much stiffer there, also where contacts begin ahead of the walls by what
they give way (MuJoCo's margin: so many m/s^2 times the square of their time constant).

``--solver`` tells instead, for solvers and tolerances, the time of a step while the stick is in its
tube, and how far from where it would be there if contacts were solved to 1e-12.
"""

import argparse
import os
import tempfile
import time
from functools import lru_cache
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from besman.config.resources import find_resource
from besman.pipeline.config import load_pipeline
from besman.pipeline.finished_run import read_run
from besman.pipeline.pipeline import run_pipeline
from besman.simulation.perturbed_trials import quarter_step_shift
from besman.simulation.scenes import lay_in_tool
from besman.simulation.setpoints import servo_setpoints
from besman.simulation.tasks.stick_throw import stick_throw
from besman.simulation.trial import try_plans

HARD = (0.8, 0.95, 0.0002)
IMPEDANCES = (
    HARD,
    (0.5, 0.95, 0.0005),
    (0.7, 0.9, 0.001),
    (0.3, 0.95, 0.0005),
    (0.1, 0.95, 0.001),
)
TOLERANCES = (("CG", 1e-7), ("CG", 1e-6), ("CG", 1e-5), ("NEWTON", 1e-8))
MARGINS = (0.0, 10.0, 50.0)
# Steps in which the stick is in its tube.
IN_TUBE, SIXTEENTH = 650, 16


def harden(impedance: tuple[float, ...]) -> None:
    """Have sticks' contacts harden otherwise from now on."""
    stick_throw._IMPEDANCE = (*impedance, 0.5, 2.0)
    stick_throw.stick_throw_model.cache_clear()


def finer(task, times: int, stiffer: int | None = None):
    simulation = task.simulation
    update = {
        "time_step_s": simulation.time_step_s / times,
        "contact_time_s": simulation.contact_time_s / (times if stiffer is None else stiffer),
    }
    return task.model_copy(update={"simulation": simulation.model_copy(update=update)})


def landings(robot, task, plans) -> np.ndarray:
    """Return where motions land, metres."""
    return np.array([try_plans(robot, task, [plan])[0].outcome[:2] for plan in plans])


def roughness(robot, task, plans, space_of) -> tuple[list[float], float]:
    """Return of every motion how rough its landing is, and the processor time of an episode."""
    random, found, places = np.random.default_rng(0), [], np.linspace(-0.4, 0.4, 9)
    start = time.process_time()
    for plan in plans:
        space = space_of(plan, robot)
        way = np.zeros(space.dimension)
        few = space.coordinates(("goal", "duration"))
        way[few] = random.standard_normal(len(few))
        way /= np.linalg.norm(way)
        trials = try_plans(robot, task, [space.plan_at(at * way) for at in places])
        off = np.array([one.outcome[:2] for one in trials]) / task.success_radius_m
        known = np.isfinite(off).all(axis=1)
        square = np.vander(places[known], 3)
        off = off[known] - square @ np.linalg.lstsq(square, off[known])[0]
        found.append(float(np.sqrt(np.square(off).sum(axis=1).mean())))
    return found, (time.process_time() - start) / (len(plans) * len(places))


def report(run: Path) -> None:
    """Print a row for every impedance."""
    finished = read_run(run)
    robot, task = finished.robot, finished.task
    plans = [motion.plan for motion in finished.motions]
    space_of = load_pipeline(run / "pipeline.yaml").refine.space
    harden(HARD)
    true = landings(robot, finer(task, SIXTEENTH), plans)
    for impedance in IMPEDANCES:
        harden(impedance)
        rough, seconds = roughness(robot, task, plans, space_of)
        shift = np.array([quarter_step_shift(robot, task, plan) for plan in plans])
        error = np.linalg.norm(landings(robot, task, plans) - true, axis=1)
        print(
            f"| {robot.name} | {' / '.join(f'{one:g}' for one in impedance)} | "
            f"{np.median(rough):.2f} / {max(rough):.2f} | {_spread(shift)} | {_spread(error)} | "
            f"{1e3 * seconds:.1f} |",
            flush=True,
        )


def report_parts(run: Path) -> None:
    """Print what the step changes, and what the contacts' stiffness."""
    finished = read_run(run)
    robot, task = finished.robot, finished.task
    plans = [motion.plan for motion in finished.motions]
    build = stick_throw.stick_throw_model.__wrapped__
    for push in MARGINS:

        @lru_cache
        def build_ahead(robot, task, push=push):
            model = build(robot, task)
            model.pair_margin[:] = push * task.simulation.contact_time_s**2
            return model

        stick_throw.stick_throw_model = build_ahead
        usual, stiff, both = (
            landings(robot, finer(task, *how), plans) for how in ((1,), (4, 1), (4,))
        )
        pairs = ((usual, both), (usual, stiff), (stiff, both))
        apart = " | ".join(_spread(np.linalg.norm(one - two, axis=1)) for one, two in pairs)
        print(f"| {robot.name} | {push:g} | {apart} |", flush=True)


def _spread(metres: np.ndarray) -> str:
    return f"{100 * np.nanmedian(metres):.2f} / {100 * np.nanmax(metres):.2f}"


def report_solver(run: Path) -> None:
    """Print a row for every impedance, solver and tolerance."""
    import mujoco
    import mujoco.rollout

    finished = read_run(run)
    robot, task = finished.robot, finished.task
    movements = task.move([motion.plan for motion in finished.motions], robot)
    controls = servo_setpoints(robot, movements, task.simulation.time_step_s)[:, :IN_TUBE]

    def simulate(solver: str, tolerance: float) -> tuple[float, np.ndarray]:
        model = stick_throw.stick_throw_model.__wrapped__(robot, task)
        model.opt.solver = getattr(mujoco.mjtSolver, f"mjSOL_{solver}")
        model.opt.tolerance = tolerance
        laid = lay_in_tool(model, movements.positions[:, 0], task.stick.length_m / 2)
        state = np.zeros(
            (len(laid), mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        )
        state[:, 1 : 1 + model.nq] = laid
        least = np.inf
        with mujoco.rollout.Rollout(nthread=0) as rollout:
            for _ in range(3):
                start = time.thread_time()
                states, _ = rollout.rollout(
                    [model] * len(laid), [mujoco.MjData(model)], state, controls, nstep=IN_TUBE
                )
                least = min(least, time.thread_time() - start)
        return least / (len(laid) * IN_TUBE), states[:, -1, 1 + robot.n : 4 + robot.n]

    for impedance in IMPEDANCES[:2]:
        harden(impedance)
        true = simulate("NEWTON", 1e-12)[1]
        for solver, tolerance in TOLERANCES:
            seconds, place = simulate(solver, tolerance)
            off = np.linalg.norm(place - true, axis=1)
            print(
                f"| {robot.name} | {' / '.join(f'{one:g}' for one in impedance)} | {solver} "
                f"{tolerance:g} | {1e6 * seconds:.2f} | {1e6 * np.median(off):.1f} / "
                f"{1e6 * off.max():.1f} |",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="*", type=Path)
    parser.add_argument("--solver", action="store_true")
    parser.add_argument("--parts", action="store_true")
    given = parser.parse_args()
    if given.solver:
        print("| robot | impedance | solver | us a step | off, median / most [um] |")
    elif given.parts:
        print("| robot | m/s^2 ahead | shift [cm] | of the step | of the stiffness |")
    else:
        print(
            "| robot | impedance | roughness [radii] | shift [cm] | error [cm] | ms an episode |\n"
            "|---|---|---|---|---|---|"
        )
    with tempfile.TemporaryDirectory() as folder:
        runs = given.runs
        if not runs:
            config = load_pipeline(find_resource("pipelines", "ur5_stick_throw"))
            runs = [run_pipeline(config, Path(folder) / "run")]
        tell = report_solver if given.solver else report_parts if given.parts else report
        for run in runs:
            tell(run)


if __name__ == "__main__":
    main()
