"""Where refined motions end up in a second physics engine: ``python benchmarks/second_engine.py``.

Runs the stick throws of each arm (synthetic: the embedded 2 subjects x 8 throws) into ``--out`` by
CMA-ES, by Gauss-Newton in the one model (``robust: null``) and as the recipe has it, and tries
what comes of it in Drake (extra ``verify``). ``--vary`` tries the motions of the default again with
other friction, contacts and steps there, and in MuJoCo at a quarter of the step. Folders that are
there already are taken as they are; ``--recipes`` says which arms or other tasks.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from besman.config.resources import find_resource
from besman.exceptions import VerificationError
from besman.pipeline.config import load_pipeline
from besman.pipeline.finished_run import read_run
from besman.pipeline.pipeline import run_pipeline
from besman.pipeline.verified_run import RADII_M
from besman.simulation.perturbed_trials import finer_task
from besman.simulation.second_engine.drake_scene import ContactModel
from besman.simulation.second_engine.engines import check_engine, try_in_second_engine
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.work.work import Work
from besman.work.workers import Workers

WAYS = {
    "cma_es": ("refine.method=cma_es",),
    "gauss_newton, not robust": ("refine.robust=null",),
    "default": (),
}
CONTACTS = {"steps half as long": {"substeps": 4}, "modulus / 10": {"modulus_pa": 5e7}}
CONTACTS["dissipation / 4"] = {"dissipation_s_m": 5.0}
FRICTIONS = (0.8, 1.2)


def refine(recipe: str, settings: tuple[str, ...], folder: Path, jobs: int) -> Path:
    """Run a recipe, if that has not been done."""
    if not (folder / "report.html").exists() and not (folder / "exports").exists():
        chosen = (*settings, "refine.robustness=null")
        config = load_pipeline(find_resource("pipelines", recipe), chosen)
        run_pipeline(config, folder, jobs=jobs)
    return folder


def show(said: str, misses, ways) -> None:
    """Print a row."""
    misses, far = np.array(misses), np.linalg.norm(ways, axis=1)
    near = " / ".join(f"{(misses <= radius).sum():2d}" for radius in RADII_M)
    known = misses[np.isfinite(misses)]
    median, most = 100 * np.median(known), 100 * known.max()
    print(
        f"| {said} | {near} of {len(misses)} | {median:.1f} / {most:.1f} "
        f"| {100 * np.nanmedian(far):.1f} / {100 * np.nanmax(far):.1f} |",
        flush=True,
    )


def verify(said: str, run, task, contact, work: Work) -> None:
    """Try all motions of a run, and print a row."""
    one = partial(try_in_second_engine, run.robot, task, contact=replace(ContactModel(), **contact))
    trials = work.map(one, [motion.plan for motion in run.motions], processes=2)
    ways = [one.outcome - motion.outcome for one, motion in zip(trials, run.motions, strict=True)]
    show(said, [one.miss for one in trials], ways)


def with_friction(task, factor: float):
    """Return a stick throw whose holder has another friction."""
    holder = task.holder.model_copy(update={"friction": factor * task.holder.friction})
    return task.model_copy(update={"holder": holder})


def vary(run, work: Work) -> None:
    """Say what the outcome depends on."""
    for factor in FRICTIONS:
        task = with_friction(run.task, factor)
        verify(f"drake, friction {task.holder.friction:.2f}", run, task, {}, work)
    for said, contact in CONTACTS.items():
        verify(f"drake, {said}", run, run.task, contact, work)
    fine = try_plans(run.robot, finer_task(run.task), [one.plan for one in run.motions], work.jobs)
    ways = [one.outcome - motion.outcome for one, motion in zip(fine, run.motions, strict=True)]
    show("mujoco, quarter of the step", [one.miss for one in fine], ways)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recipes", nargs="+", default=["ur5_stick_throw"])
    parser.add_argument("--ways", nargs="+", default=list(WAYS), choices=list(WAYS))
    parser.add_argument("--vary", action="store_true")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    chosen = parser.parse_args()
    out = chosen.out or Path(tempfile.mkdtemp())
    try:
        check_engine("drake", load_task("stick_throw"))
    except VerificationError as error:
        print(error)
        return
    print(
        "| motions | within 5 / 10 cm | miss, median / most [cm] | apart [cm] |\n|---|---|---|---|"
    )
    with Workers(chosen.jobs) as workers:
        work = Work(chosen.jobs, workers=workers)
        for recipe in chosen.recipes:
            for way in chosen.ways:
                name = f"{recipe}_{way.replace(', ', '_').replace(' ', '_')}"
                run = read_run(refine(recipe, WAYS[way], out / name, chosen.jobs))
                verify(f"{recipe}, {way}", run, run.task, {}, work)
                if chosen.vary and way == "default":
                    vary(run, work)


if __name__ == "__main__":
    main()
