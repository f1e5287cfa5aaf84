"""Gauss-Newton, CMA-ES and a derivative-free least-squares peer on the same motions.

    python benchmarks/gauss_newton.py [PIPELINE ...] [--methods NAME ...] [--models N] [--jobs N]
                                      [--seeds N ...] [--neighbours N] [--set KEY=VALUE ...]
                                      [--json FILE]

Refines every motion of each pipeline (synthetic recordings), and tries what comes of it in N
perturbed models that no search has seen. Methods: ``cma_es``, as the recipes had it;
``gauss_newton`` with ``robust: null``; ``robust``, as it is by default; ``dfols``, DFO-LS (package
``DFO-LS``, extra ``bench``) on the landing point in the model as it is, from the same start in the
same coordinates. ``robust`` is searched in the models of every one of ``--seeds``: what one draw
finds is chance. ``--set map.seed=1`` gives other imitations of the same throws to choose on.
"""

import argparse
import json
import os
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from besman.config.resources import find_resource
from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.pipeline.stored_run import open_run
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.refine.begin_plan import begin_plan
from besman.stages.refine.gauss_newton import GaussNewtonConfig
from besman.stages.refine.robustness import RobustnessConfig
from besman.stages.refine.stage import CmaEsConfig, RefinementConfig
from besman.work.work import Work
from besman.work.workers import Workers

METHODS = ("cma_es", "gauss_newton", "robust", "dfols")
# Of the models that judge; the search's own are drawn otherwise, whatever the seed.
JUDGE = 20
_PARTS = ("goal", "duration")


@dataclass
class Case:
    """The imitations of a pipeline."""

    name: str
    plans: tuple
    robot: object
    task: object
    refine: object


def load_case(name: str, folder: Path, settings: tuple[str, ...] = ()) -> Case:
    path = find_resource("pipelines", name)
    quick = (*settings, "refine.episodes=1", "refine.robustness=null")
    config = load_pipeline(path, settings)
    run = run_pipeline(load_pipeline(path, quick), folder / name)
    robot, task = load_robot(config.robot, config.tool), load_task(config.task)
    return Case(name, open_run(run).record("imitate"), robot, task, config.refine)


def stage_of(method: str, case: Case):
    kind = CmaEsConfig if method == "cma_es" else GaussNewtonConfig
    keys = {name: getattr(case.refine, name) for name in RefinementConfig.model_fields}
    keys |= {"method": kind.model_fields["method"].annotation.__args__[0], "robustness": None}
    if method == "robust":
        own = ("measure", "robust", "neighbours")
        keys |= {name: getattr(case.refine, name) for name in own if hasattr(case.refine, name)}
    elif kind is GaussNewtonConfig:
        keys["robust"] = None
    return kind.model_validate(keys)


def with_seed(refine, seed: int, neighbours: int | None):
    """Return a recipe's search in the models of a seed, with so many neighbours."""
    changes = {"robust": refine.robust.model_copy(update={"seed": seed})}
    if neighbours is not None:
        changes["neighbours"] = neighbours
    return refine.model_copy(update=changes)


def refine(method: str, case: Case, work: Work) -> tuple[list, list, int, int]:
    """Return plans, simulations of each, simulations shared, how many succeed."""
    if method == "dfols":
        found = [by_dfols(plan, case) for plan in case.plans]
        return [f[0] for f in found], [f[1] for f in found], 0, sum(f[2] for f in found)
    motions = stage_of(method, case).run(case.plans, case.robot, case.task, work)
    shared = sum(motion.shared_simulations for motion in motions)
    needed = [int(motion.simulations.sum()) for motion in motions]
    return [m.plan for m in motions], needed, shared, sum(m.success for m in motions)


def by_dfols(plan, case: Case) -> tuple:
    """Search one motion by DFO-LS until its landing is within half of the radius."""
    import dfols

    plan = begin_plan(plan, case.robot, case.task)
    stage = stage_of("gauss_newton", case).model_copy(update={"search": _PARTS})
    space, tried = stage.space(plan, case.robot), []

    class EnoughError(Exception):
        """The landing is near enough."""

    def residual(point):
        (trial,) = try_plans(case.robot, case.task, [space.plan_at(point)])
        tried.append((trial, np.array(point)))
        if trial.success and trial.miss <= 0.5 * case.task.success_radius_m:
            raise EnoughError
        return np.full(2, 10.0) if trial.failure else np.asarray(trial.residual)

    with suppress(EnoughError):
        dfols.solve(residual, np.zeros(space.dimension), maxfun=case.refine.episodes, rhobeg=0.5)
    best = max(tried, key=lambda one: (one[0].success, one[0].reward))
    return space.plan_at(best[1]), len(tried), best[0].success


def report(case: Case, method: str, models: int, work: Work, seed: int) -> dict:
    wall, cpu = time.perf_counter(), time.process_time()
    plans, needed, shared, n_success = refine(method, case, work)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    judge = RobustnessConfig(models=models, seed=JUDGE)
    found = judge.run([_Planned(plan) for plan in plans], case.robot, case.task, work)
    shares = np.array([one.success.mean() for one in found])
    total = sum(needed) + shared
    print(
        f"| {case.name} | {method} | {seed} | {n_success} of {len(plans)} | "
        f"{np.median(needed):g} / {max(needed)} | {shared} | {total} | "
        f"{total / len(plans):.1f} | {shares.mean():.3f} | "
        f"{shares.min():.2f} | {wall:.1f} |",
        flush=True,
    )
    return {
        "dataset": case.name, "source": "synthetic", "method": method, "seed": seed,
        "n": len(plans), "n_success": n_success, "episodes": needed, "episodes_shared": shared,
        "hit_share": shares.tolist(), "wall_s": wall, "cpu_s": cpu,
    }  # fmt: skip


@dataclass
class _Planned:
    """A motion of which the plan alone is known."""

    plan: object
    outcome: np.ndarray = field(default_factory=lambda: np.full(3, np.nan))
    finer_outcome: np.ndarray = field(default_factory=lambda: np.full(3, np.nan))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pipelines", nargs="*", default=["ur5_stick_throw"])
    parser.add_argument("--methods", nargs="+", default=METHODS[:3], choices=METHODS)
    parser.add_argument("--models", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--neighbours", type=int, help="of a second round; 0 for none")
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", dest="settings")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    rows = []
    print(
        "| pipeline | method | seed | succeed | episodes, median / most | shared | all | mean "
        "| hit share | least | refine s |\n|---|---|---|---|---|---|---|---|---|---|---|"
    )
    with tempfile.TemporaryDirectory() as folder, Workers(given.jobs) as workers:
        for name in given.pipelines:
            case = load_case(name, Path(folder), tuple(given.settings))
            work = Work(given.jobs, workers=workers)
            own = case.refine
            for method in given.methods:
                for seed in given.seeds if method == "robust" else (0,):
                    if method == "robust":
                        case.refine = with_seed(own, seed, given.neighbours)
                    rows.append(report(case, method, given.models, work, seed))
                    case.refine = own
    if given.json is not None:
        given.json.write_text(json.dumps({"experiment": "gauss_newton", "rows": rows}))


if __name__ == "__main__":
    main()
