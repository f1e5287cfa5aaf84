"""Plans from the blocks of a run to files (synthetic): what was simulated is what is exported."""

import dataclasses
import functools
import json

import numpy as np
import pytest
from command_line import besman
from small_runs import Keep
from whole_task import block_goals, learn_both

from besman.config.resources import find_resource
from besman.exceptions import FileError, PlanError, RunError
from besman.io.exports import read_joint_csv
from besman.motion.task_rollout import sample_task
from besman.pipeline.check_run import check_run
from besman.pipeline.config import load_pipeline, pipeline_yaml
from besman.pipeline.plan_folders import FOLDER, PLAN
from besman.pipeline.run_folder import Run
from besman.planning import attempts
from besman.planning.goals import parse_goals, parse_start
from besman.planning.learnt import read_learnt
from besman.planning.planned_run import plan_goals, plan_run
from besman.records.files import load_record
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.simulation.tasks.rearrange.boxes import box_poses
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig

GOAL = "box1 on table at x=0.1,y=-0.6"
TWICE = "box1 on table at x=0.15,y=-0.55; box1 on table at x=0.2,y=-0.62"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A finished run that holds what plans are made of."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    learnt = learn_both()
    made = Run(folder, "whole")
    made.start(pipeline_yaml(load_pipeline(find_resource("pipelines", "iiwa7_pick_and_place"))), {})
    made.step("task_plans", Keep(), learnt.bench.plans)
    made.step("simulate", Keep(), ())
    made.finish()
    return folder


@functools.cache
def planned(goal, refine=False):
    return plan_goals("plan:1", parse_goals(goal), (), learn_both(), refine)


def test_the_box_stands_where_nobody_has_put_it():
    made = planned(GOAL)
    assert made.success, made.trial.failure
    labels = [one.label for one in made.blocks]
    assert labels == ["approach_forward", "move_obj_table", "move_to_rest_right"]
    np.testing.assert_allclose(made.trial.wanted[0, :2], [0.1, -0.6], atol=1e-9)
    np.testing.assert_allclose(made.trial.outcomes[0, :2], [0.1, -0.6], atol=0.02)
    assert made.plan.between_poses.shape == (0, 7)
    # The same again is the same to the last bit.
    again = plan_goals("plan:1", parse_goals(GOAL), (), learn_both(), False)
    for one, other in zip(sample_task(made.plan), sample_task(again.plan), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(made.trial.outcomes, again.trial.outcomes)


def test_blocks_join_with_their_velocity_and_keep_all_limits():
    """Two legs, the second an order of blocks that nobody has shown."""
    made = planned(TWICE)
    assert [one.label for one in made.blocks][3:5] == ["approach_right", "move_obj_table"]
    assert made.success, made.trial.failure
    first, second = made.legs
    np.testing.assert_allclose(first.trial.outcomes[0, :3], first.after[0, :3], atol=0.02)
    stood = first.trial.outcomes if first.trial.miss >= 0.002 else first.after
    np.testing.assert_allclose(second.before[0, :2], stood[0, :2], atol=1e-9)
    np.testing.assert_allclose(second.before[0, 2], first.after[0, 2], atol=1e-9)
    assert made.trial is second.trial
    time, q, v, a = sample_task(made.plan)
    report = check_limits(learn_both().bench.robot, q, v, a)
    assert report.position + report.velocity + report.acceleration + report.torque == 0
    assert report.self_collisions == 0
    assert np.max(np.abs(np.diff(v, axis=0))) < 1.1e-3 * np.max(np.abs(a))
    assert np.max(np.abs(np.diff(q, axis=0))) < 1.1e-3 * np.max(np.abs(v))
    assert made.plan.events == ("close", "open") * 2
    assert time[-1] == pytest.approx(sum(one.duration_s for one in made.blocks), abs=1e-3)
    assert np.all(np.diff(made.plan.events_s) > 0)
    # Where it stands only meanwhile is a place in the world, with a board of its own.
    assert made.plan.between_poses.shape == (1, 7)
    frames = [block.frame for block in made.plan.blocks]
    assert frames == ["object"] * 3 + ["world"] * 7 + ["target"] * 3 + ["world"]
    reached = forward_kinematics(learn_both().bench.robot.chain, block_goals(made.plan))
    for block, pose in zip(made.plan.blocks[3:6], reached[3:6], strict=True):
        np.testing.assert_allclose(block.goal_pose[:3], pose[:3, 3], atol=0.006)


def test_other_ways_are_tried_until_one_succeeds(monkeypatch):
    trial, tried = planned(GOAL).trial, []

    def simulate(task, plans, *more):
        tried.append(plans[0])
        miss_m = (0.5, 0.3, 0.4, 0.0)[len(tried) - 1]
        return [dataclasses.replace(trial, success=miss_m == 0, misses=np.array([miss_m]))]

    monkeypatch.setattr(RearrangeConfig, "try_tasks", simulate)
    monkeypatch.setattr(attempts, "_MOST_WAYS", 30)
    (leg,) = plan_goals("p", parse_goals(GOAL), (), learn_both()).legs
    assert (leg.trial.success, len(tried)) == (True, 4)
    assert leg.tries >= 4
    ways = {plan.blocks[0].goal.tobytes() + plan.blocks[4].goal.tobytes() for plan in tried}
    assert len(ways) > 1
    tried.clear()
    (leg,) = plan_goals("p", parse_goals(GOAL), (), learn_both(), refine=False).legs
    assert (leg.trial.miss, len(tried)) == (0.5, 1)


def test_a_box_that_slips_is_taken_from_where_it_stands_and_judged_by_where_it_was_to(monkeypatch):
    """A simulation after which each first leg has left the box 12 mm beside its place."""
    real = RearrangeConfig.try_tasks
    taken_at, boards = [], []

    def slip(task, plans, robot, frame):
        (trial,) = real(task, plans, robot, frame)
        if len(plans[0].events) == 2:
            moved = trial.wanted + np.array([0.012, 0, 0, 0, 0, 0, 0])
            trial = dataclasses.replace(trial, outcomes=moved, misses=np.array([0.012]))
        return [trial]

    lead = RearrangeConfig.lead

    def watch(task, plan, robot, frame, grasp, places=()):
        taken_at.append(box_poses(plan.object_poses, frame)[0])
        boards.append([np.round(place, 6).tolist() for place in places])
        return lead(task, plan, robot, frame, grasp, places)

    monkeypatch.setattr(RearrangeConfig, "try_tasks", slip)
    monkeypatch.setattr(RearrangeConfig, "lead", watch)
    first, second = plan_goals("p", parse_goals(TWICE), (), learn_both(), False).legs
    np.testing.assert_allclose(taken_at[-1][:2], first.after[0, :2] + [0.012, 0.0], atol=1e-6)
    np.testing.assert_allclose(second.before[0, 2:], first.after[0, 2:], atol=1e-6)
    np.testing.assert_allclose(second.trial.wanted, second.after, atol=1e-9)
    # The board of the start is still there, and that from which it is taken.
    for pose in (first.before[0], first.after[0]):
        assert np.round(pose, 6).tolist() in boards[-1]


def test_the_first_ways_differ_in_each_of_their_values():
    """Each of the other values is looked at before they are paired."""
    task = learn_both().bench.task
    ranked = attempts._rank_grasps(task, over=True)
    keys = [*type(task.ways).model_fields, "up_m"]
    rows = [tuple(getattr(grasp, key) for key in keys) for _, grasp in ranked]
    n_values = [len(set(column)) for column in zip(*rows, strict=True)]
    assert len(set(rows)) == len(rows) == np.prod(n_values)
    first = rows[0]
    assert first[-1] > task.box.size_m[2]
    assert first[keys.index("before_m")] == max(task.ways.before_m)
    near = rows[1 : 1 + len(keys)]
    assert all(sum(a != b for a, b in zip(row, first, strict=True)) == 1 for row in near)
    assert [away for away, _ in ranked] == sorted(away for away, _ in ranked)


def test_a_second_box_stays_where_it_stands():
    start = parse_start("box1 on shelf; box2 on table at x=0.3,y=0.55")
    made = plan_goals(
        "p", parse_goals("box1 on table at x=0.1,y=-0.6"), start, learn_both(), refine=False
    )
    assert made.plan.objects == ("box1", "box2")
    np.testing.assert_array_equal(made.plan.object_poses[1], made.plan.target_poses[1])
    assert made.trial.misses[1] < 0.02
    assert len(made.trial.misses) == 2


def test_a_plan_is_written_whole_with_digests_and_nothing_is_written_over(
    run, capsys, tmp_path, monkeypatch
):
    said = tmp_path / "said.json"
    arguments = ("plan", run, "--goal", GOAL, "--json", said)
    code = besman(monkeypatch, *arguments)
    out = capsys.readouterr().out
    assert code == 0
    assert "move_obj_table" in out
    assert "succeeds in simulation" in out
    folder = run / FOLDER / "1"
    content = json.loads((folder / PLAN).read_text())
    assert content == json.loads(said.read_text())
    assert [one["label"] for one in content["blocks"]] == [
        one.label for one in planned(GOAL).blocks
    ]
    (plan,) = load_record(folder / "plan.npz")
    assert plan.name == "plan:1"
    _, q, v, a = sample_task(planned(GOAL).plan)
    _, *written = read_joint_csv(folder / "plan_1.csv")
    for one, other in zip(written, (q, v, a), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert {"plan_1.gripper.csv", "plan_1.task.ros.json", "limits.json"} <= before.keys()
    assert besman(monkeypatch, *arguments, "--name", "1") == 2
    assert "is there already; expected another --name" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    whole, faults = check_run(run)
    assert "plans: 1: whole" in whole
    assert not [fault for fault in faults if "plan" in fault]
    (folder / "plan_1.csv").write_text("cut")
    assert "plans/1/plan_1.csv is cut or changed" in check_run(run)[1]
    (folder / PLAN).write_text(json.dumps(content | {"of": "other"}))
    assert "plans/1 is made of other tasks than the run holds" in check_run(run)[1]
    (folder / PLAN).write_text("{}")
    assert any("plans/1/plan.json is not as besman writes it" in one for one in check_run(run)[1])
    (folder / PLAN).write_text("{")
    assert any("plan.json: cannot be read" in one for one in check_run(run)[1])


@pytest.mark.parametrize(
    ("name", "message"),
    [("../a", "is no name of a folder"), ("", "is empty"), (".a", "is no name of a folder")],
)
def test_a_name_is_one_of_a_folder(run, name, message):
    with pytest.raises(FileError, match=message):
        plan_run(run, parse_goals("box1 on table"), name=name)


def test_what_fails_writes_nothing(run, capsys, monkeypatch):
    before = sorted(run.rglob("*"))
    for arguments, message in (
        (("--goal", "box1 on tabel"), "did you mean 'table'"),
        ((), "expected one of --goal and --goals, got none"),
        (("--goal", "box1 on table", "--goals", run / "no.yaml"), "got both"),
        (("--goals", run / "no.yaml"), "no such file"),
        (("--goal", "box1 on table", "--start", "box1 on table"), "holds already"),
    ):
        assert besman(monkeypatch, "plan", run, *arguments) == 2
        assert message in capsys.readouterr().err.splitlines()[-1]
    assert sorted(run.rglob("*")) == before


def test_goals_of_a_file_have_one_start(tmp_path, run, capsys, monkeypatch):
    path = tmp_path / "goals.yaml"
    path.write_text("start: [box1 on shelf]\ngoals: [box1 on tabel]\n")
    assert besman(monkeypatch, "plan", run, "--goals", path, "--start", "box1 on table") == 2
    assert "has a start too; expected one of them" in capsys.readouterr().err
    assert besman(monkeypatch, "plan", run, "--goals", path) == 2
    assert "no place 'tabel'" in capsys.readouterr().err


def test_only_finished_runs_of_whole_tasks_are_planned_with(small_run, tmp_path):
    with pytest.raises(RunError, match="is one of single movements; expected a run of whole tasks"):
        read_learnt(small_run)
    with pytest.raises(RunError, match=r"not a run: pipeline.yaml is missing"):
        read_learnt(tmp_path)
    folder = tmp_path / "run"
    made = Run(folder, "whole")
    made.start(pipeline_yaml(load_pipeline(find_resource("pipelines", "iiwa7_pick_and_place"))), {})
    made.finish("failed", "stopped")
    with pytest.raises(RunError, match=r"the run is not done \(status 'failed'\)"):
        read_learnt(folder)


def test_a_goal_without_a_way_names_the_block():
    with pytest.raises(PlanError, match="plan: approach_forward: its goal at the object 'box1' is"):
        plan_goals(
            "plan", parse_goals("box1 on table"), parse_start("box1 on shelf at x=3,y=0"),
            learn_both(), refine=False,
        )  # fmt: skip
