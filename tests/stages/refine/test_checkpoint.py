import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from besman.pipeline.run_folder import Run
from besman.records.files import save_record
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import Trial, try_plans
from besman.stages.refine.checkpoint import Checkpoint, Generation
from besman.stages.refine.stage import CmaEsConfig
from besman.work.work import Work

THROW = load_task("stick_throw")
FAR = np.array([5.0, 0, 0])


def trial(reward, failure=""):
    return Trial(
        reward, np.nan, np.nan, np.array([1.0, np.nan, 0]), failure, False, np.empty((0, 3))
    )


def refined(config, plans, robot, folder=None):
    return config.run(plans, robot, THROW, Work(checkpoints=folder))


def assert_same(one, two):
    np.testing.assert_array_equal(one.returns, two.returns)
    np.testing.assert_array_equal(one.positions, two.positions)
    np.testing.assert_array_equal(one.object_path, two.object_path)
    np.testing.assert_array_equal(one.finer_outcome, two.finer_outcome)


def config_of(method, **more):
    from pydantic import TypeAdapter

    from besman.stages.refine.methods import RefineStage

    # The imitation alone, two generations, and a part of one.
    few = {"method": method, "episodes": 24, "population": 8}
    return TypeAdapter(RefineStage).validate_python({**few, **more})


def test_generations_come_back_as_they_were(tmp_path):
    kept = Checkpoint(tmp_path, "a")
    assert kept.load() == []
    for index in range(3):
        kept.save(index, Generation(np.full((2, 4), index + 0.1), (trial(-1.5, "lost"), trial(0))))
    found = Checkpoint(tmp_path, "a").load()
    assert len(found) == 3
    np.testing.assert_array_equal(found[2].points, np.full((2, 4), 2.1))
    first = found[1].trials[0]
    assert (first.reward, first.failure, first.success) == (-1.5, "lost", False)
    np.testing.assert_array_equal(first.outcome, [1, np.nan, 0])
    assert Checkpoint(tmp_path, "b").load() == []


def test_what_is_damaged_ends_the_list(tmp_path):
    kept = Checkpoint(tmp_path, "a")
    for index in range(3):
        kept.save(index, Generation(np.zeros((1, 2)), (trial(index),)))
    (tmp_path / "a" / "000001.npz").write_bytes(b"")
    assert len(kept.load()) == 1
    assert not list((tmp_path / "a").glob(".*"))


def test_without_a_folder_nothing_is_kept(tmp_path):
    for folder in (None, tmp_path / "not there"):
        Checkpoint(folder, "a").save(0, Generation(np.zeros((1, 2)), ()))
        assert Checkpoint(folder, "a").load() == []
    assert not list(tmp_path.iterdir())


def test_what_is_finished_is_not_tried_again(robot, make_plan, tmp_path, monkeypatch):
    from besman.stages.refine.search_loop import RunningSearch

    plans, config = (make_plan(0.54, target=FAR),), config_of("cma_es")
    (whole,) = refined(config, plans, robot, tmp_path)
    monkeypatch.setattr(RunningSearch, "advance", lambda self: pytest.fail("tried again"))
    (again,) = refined(config, plans, robot, tmp_path)
    assert_same(again, whole)


def test_what_another_search_has_kept_is_not_used(robot, make_plan, tmp_path):
    plans = (make_plan(0.54, target=FAR),)
    refined(config_of("cma_es", seed=1), plans, robot, tmp_path)
    (whole,) = refined(config_of("cma_es"), plans, robot)
    (fresh,) = refined(config_of("cma_es"), plans, robot, tmp_path)
    assert_same(fresh, whole)


def test_what_the_finer_step_said_before_the_end_is_known_after_it(robot, make_plan, tmp_path):
    plan = make_plan(0.54)
    (trial,) = try_plans(robot, THROW, [plan])
    plans = (replace(plan, target=trial.outcome),)
    config = CmaEsConfig(episodes=8)
    (whole,) = refined(config, plans, robot, tmp_path)
    assert np.isfinite(whole.finer_outcome).all()
    (again,) = refined(config, plans, robot, tmp_path)
    assert_same(again, whole)


def test_two_plans_of_one_name_do_not_share_what_they_keep(robot, make_plan, tmp_path):
    plans = (make_plan(0.54, target=FAR), make_plan(0.6, target=FAR))
    whole = refined(config_of("cma_es"), plans, robot)
    for _ in range(2):
        kept = refined(config_of("cma_es"), plans, robot, tmp_path)
        for one, two in zip(kept, whole, strict=True):
            assert_same(one, two)


def test_a_pool_ended_in_the_middle_of_a_generation_goes_on(robot, make_plan, tmp_path):
    plans = tuple(make_plan(0.5 + 0.04 * at, name=str(at), target=FAR) for at in range(3))
    config = CmaEsConfig(episodes=24, pool=True)
    (whole,) = refined(config, plans, robot)
    refined(config, plans, robot, tmp_path)
    for at, own in enumerate(sorted(tmp_path.iterdir())):
        for path in sorted(own.iterdir())[2 + at % 2 :]:
            path.unlink()
    (resumed,) = refined(config, plans, robot, tmp_path)
    assert_same(resumed, whole)


def test_a_run_keeps_checkpoints_until_the_stage_is_stored(robot, make_plan, tmp_path):
    class Watched(CmaEsConfig):
        def run(self, plans, robot, task, work=Work()):
            done = super().run(plans, robot, task, work)
            seen.append(sorted(work.checkpoints.rglob("*.npz")))
            return done

    seen = []
    plans = (make_plan(0.54, target=FAR),)
    run = Run(tmp_path / "run", "a")
    run.start("", {})
    config = Watched(episodes=10)
    run.step("refine", config, plans, robot, THROW)
    assert len(seen[0]) == 3
    assert not list((tmp_path / "run").glob(".*going"))
    left = tmp_path / "run" / ".01_refine.going" / "of another config"
    left.mkdir(parents=True)
    run.step("refine", config.model_copy(update={"episodes": 2}), plans, robot, THROW)
    assert not left.parent.exists()
    run.finish()


# Long enough to be killed on the way.
EPISODES = 24
SCRIPT = """
import itertools
import sys
import time
from pathlib import Path

from besman.records.files import load_record
from besman.stages.refine.checkpoint import Checkpoint
from besman.stages.refine.stage import CmaEsConfig
from besman.robot.model import load_robot
from besman.pipeline.run_folder import Run
from besman.simulation.tasks.kinds import load_task

save, numbers = Checkpoint.save, itertools.count(1)

def hold(checkpoint, index, generation):
    save(checkpoint, index, generation)
    if next(numbers) >= 7:
        time.sleep(600)

# So that it is not over before it is killed, however seldom that process has its turn.
Checkpoint.save = hold
plans, folder = load_record(Path(sys.argv[1])), Path(sys.argv[2])
robot, task = load_robot("ur5", "stick_holder"), load_task("stick_throw")
run = Run(folder, "a", jobs=2)
run.start("", {})
run.step("refine", CmaEsConfig(episodes=int(sys.argv[3])), plans, robot, task)
run.finish()
"""


def start_run(plans, folder):
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", SCRIPT, str(plans), str(folder), str(EPISODES)]
    return subprocess.Popen(command, env=environment)


@pytest.mark.slow
def test_a_killed_run_goes_on_and_ends_with_the_same_bytes(robot, make_plan, tmp_path, monkeypatch):
    plans, folder = tmp_path / "plans.npz", tmp_path / "killed"
    far = tuple(make_plan(0.5 + 0.04 * at, name=str(at), target=FAR) for at in range(3))
    save_record(far, plans)
    kept = ".*_refine.going/*/*/*.npz"
    process = start_run(plans, folder)
    until = time.monotonic() + 300
    while len(list(folder.glob(kept))) < 7:
        assert process.poll() is None
        assert time.monotonic() < until
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = {(path.parent.name, path.name) for path in folder.glob(kept)}
    assert not list(folder.glob("*_refine"))
    # The second run takes over what the first one has kept, and keeps the rest.
    save, written = Checkpoint.save, set()

    def watch(checkpoint, index, generation):
        save(checkpoint, index, generation)
        written.add((checkpoint._folder.name, f"{index:06d}.npz"))

    monkeypatch.setattr(Checkpoint, "save", watch)
    run = Run(folder, "a", jobs=2)
    run.start("", {})
    run.step("refine", CmaEsConfig(episodes=EPISODES), far, robot, THROW)
    run.finish()
    assert written
    assert not written & before
    monkeypatch.undo()
    save_record(CmaEsConfig(episodes=EPISODES).run(far, robot, THROW), tmp_path / "whole.npz")
    whole = (tmp_path / "whole.npz").read_bytes()
    assert (folder / "00_refine" / "record.npz").read_bytes() == whole
    assert not list(folder.glob(".*going"))


def test_the_same_plan_has_the_same_name(robot, make_plan, tmp_path):
    plan = make_plan(0.54, target=FAR)
    refined(CmaEsConfig(episodes=2), (plan,), robot, tmp_path)
    refined(CmaEsConfig(episodes=2), (replace(plan, weights=plan.weights.copy()),), robot, tmp_path)
    assert len(list(tmp_path.iterdir())) == 1
