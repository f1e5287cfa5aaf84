"""A run of two quick stages and exports, to look at the folder that it leaves."""

import json
from dataclasses import replace

import numpy as np

from besman.config.stage import Stage, Work
from besman.motion.dmp import roll_out
from besman.pipeline.run_folder import Run
from besman.records import RefinedMotion, Segments
from besman.stages.select.stage import SelectConfig

CALLS = []
START = Segments([[0, 9]], 0.0, 1.0, "x")


def keep_demonstrations(monkeypatch, n):
    """Have only the first n demonstrations, or a slice, go on; return a list of all, once found."""
    kept = n if isinstance(n, slice) else slice(n)
    select, found = SelectConfig.run, []

    def select_some(*arguments, **options):
        found[:] = select(*arguments, **options)
        return tuple(found[kept])

    monkeypatch.setattr(SelectConfig, "run", select_some)
    return found


class Cut(Stage):
    method: str = "cut"
    at: int = 1

    def run(self, segments, *, work=Work()):
        CALLS.append((self.at, segments.log_evidence))
        work.progress(0.5)
        return Segments([[0, self.at], [self.at, 9]], segments.log_evidence + 1, 1.0, "x")

    def figures(self, result, truth, segments):
        return {"n": len(result.bounds)}


class Keep(Stage):
    """Take motions as they are: what other stages made of recordings."""

    method: str = "keep"

    def run(self, motions, work=Work()):
        CALLS.append(len(motions))
        return motions


def refined(plan):
    """Make a refined motion of a plan that nobody searched for."""
    time = np.arange(int(np.ceil(plan.duration * 1000)) + 1) / 1000
    movement = roll_out(plan.weights, plan.start, plan.goal, plan.duration, time)
    return RefinedMotion(
        plan, time, *movement, np.zeros(1), np.zeros(1), np.zeros(3), np.zeros(3),
        np.empty((0, 3)), np.zeros((len(time), 3)), True, 0.0, 0.0,
    )  # fmt: skip


def short_motions(make_plan, names, duration=0.1):
    """Make one motion that lasts a tenth of a second, under several names."""
    motion = refined(make_plan(duration))
    return tuple(replace(motion, plan=replace(motion.plan, name=name)) for name in names)


def run_two_stages(folder, first=1, second=2, fresh=None, names=("one", "two")):
    """Run two stages; return the second's result, and which were cached."""
    run = Run(folder, "test", fresh=fresh)
    run.start(f"name: test\nfirst: {first}\nsecond: {second}\nnames: {list(names)}\n", {})
    one = run.step(names[0], Cut(at=first), START)
    two = run.step(names[1], Cut(at=second), one)
    run.finish()
    return two, [row["cached"] for row in run.timing]


def run_exports(folder, motions, robot, more=(), arms=("",)):
    """Run a recipe that ends with motions: stage `refine` and exports, for one arm or two."""
    run = Run(folder, "test")
    names = [motion.plan.name for motion in motions]
    run.start(f"name: test\nrobot: ur5\ntask: reach\nmotions: {names}\nmore: {list(more)}\n", {})
    for number, name in enumerate(more):
        run.step(name, Cut(at=1 + number), START)
    for arm in arms:
        kept = run.step(f"refine{arm}", Keep(), motions)
        run.export(f"exports{arm}", kept, robot)
    run.finish()


def state_of(folder):
    return json.loads((folder / "run.json").read_text())
