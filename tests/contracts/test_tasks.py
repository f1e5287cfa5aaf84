"""What every kind of task keeps to; a new one needs its entry in `KINDS` and its file, no more.

A kind that a movement of the UR5 from rest to rest does not suit has a line in `SAMPLES` too.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from contact_motions import approach_of, pull_of
from places import TOP
from pydantic import TypeAdapter

from besman.exceptions import ConfigError, RefinementError
from besman.geometry.frames import rotation_to_quaternion
from besman.motion.dmp_fit import fit_weights
from besman.records import JointTrajectory, MotionPlan
from besman.report.motions import motion_sections
from besman.report.run_records import ArmRecords
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.robot.model import load_robot
from besman.simulation.episodes import Movements
from besman.simulation.perturbation import Spreads, draw_perturbation
from besman.simulation.perturbed_trials import try_perturbed
from besman.simulation.task import Task
from besman.simulation.tasks.kinds import KINDS, WHOLE_KINDS, load_task
from besman.simulation.trial import try_plans
from besman.stages.map.mapping import Mapping
from besman.stages.refine.figures import refine_results
from besman.stages.refine.methods import RefineStage
from besman.templates.applying import apply_template
from besman.templates.contexts import context_kind
from besman.templates.learning import TemplateConfig
from besman.templates.teaching import prepare_lesson, teach
from besman.view.packing import Packer
from besman.view.takes import DemonstrationInPlan, simulated_takes

EVERY = pytest.mark.parametrize("entry", KINDS, ids=lambda entry: entry.name)
START = np.array([1.52, -3.75, 0.54, -1.39, -0.70, -0.12])
GOAL = np.array([2.09, -3.15, 0.33, -2.02, -1.48, -0.62])
# With a scoop, over its shoulder, at the speed limit.
SCOOP_START = np.array([0.18, -0.99, 1.3, 0.0, 1.75, -1.57])
SCOOP_GOAL = np.array([0.18, -2.86, 1.95, -1.15, 1.75, -1.57])
REFINE = TypeAdapter(RefineStage).validate_python({"episodes": 9, "robustness": None})
TEACH = TemplateConfig(method="c_reps", episodes=10, population=10, checks=10)


def move_of(robot, duration=2.5, start=START, goal=GOAL):
    """Move from rest to rest; a throw, if it is fast."""
    x = np.linspace(0, 1, 61)
    blend = (10 * x**3 - 15 * x**4 + 6 * x**5)[:, None]
    poses = forward_kinematics(robot.chain, np.stack([start, goal]))
    ends = np.column_stack([poses[:, :3, 3], rotation_to_quaternion(poses[:, :3, :3])])
    return MotionPlan(
        weights=fit_weights(x, start + blend * (goal - start), 10),
        start=start,
        goal=goal,
        duration=duration,
        joint_names=robot.joint_names,
        rmse=0.0,
        goal_pose=ends[1],
        start_pose=ends[0],
        target=np.full(3, np.nan),
        name="a.tsv:1",
        label="x",
    )


@dataclass(frozen=True)
class Sample:
    """A movement with which a task succeeds, or comes near to it."""

    plan: Callable[..., Any] = move_of
    robot: str = "ur5"
    changes: dict[str, Any] = field(default_factory=dict)


SAMPLES = {
    "stick_throw": Sample(lambda robot: move_of(robot, 0.54)),
    "ball_throw": Sample(
        lambda robot: move_of(robot, 1.25, SCOOP_START, SCOOP_GOAL), changes={"target_m": None}
    ),
    "grasp_box": Sample(approach_of, "iiwa7"),
    "pull_lever": Sample(pull_of, "ur10"),
}

# How many numbers say how far off an outcome is; none where a task only succeeds or not. A new kind
# need not be here: what is said of their norm holds for any number of them.
RESIDUALS = {"stick_throw": 2, "ball_throw": 2, "grasp_box": 0, "pull_lever": 1, "reach": 6}


@dataclass(frozen=True, eq=False)
class Case:
    """A kind with its robot and a movement."""

    robot: Any
    task: Any
    plan: Any

    def try_out(self, *plans, **options):
        return try_plans(self.robot, self.task, [*plans] or [self.plan], **options)


@cache
def case_of(name):
    sample = SAMPLES.get(name, Sample())
    task = load_task(name).model_copy(update=sample.changes)
    robot = load_robot(sample.robot, task.tool)
    plan = task.place(sample.plan(robot), robot)
    if not np.isfinite(plan.target).all() and "target" in task.placed_by:
        # What comes of it is what was to come.
        (trial,) = try_plans(robot, task, [replace(plan, target=np.zeros(3))])
        plan = task.place(replace(plan, target=trial.outcome), robot)
    return Case(robot, task, plan)


@cache
def motions_of(name):
    case = case_of(name)
    return REFINE.run((case.plan,), case.robot, case.task)


def assert_same(one, two):
    assert (one.reward, one.failure, one.success) == (two.reward, two.failure, two.success)
    np.testing.assert_array_equal(one.outcome, two.outcome)


@EVERY
def test_the_entry_names_a_class_and_a_file(entry):
    config = entry.load()
    assert config.model_fields["kind"].annotation.__args__ == (entry.name,)
    # The file says what is usual.
    assert load_task(entry.name) == config(kind=entry.name)
    assert set(config.placed_by) <= {"target", "start_pose", "goal_pose"}
    assert config.needs
    for words in (entry.scene, entry.refined, entry.outcome):
        assert words.strip()
        assert "\n" not in words


def test_messages_and_page_go_through_the_table(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text("kind: juggle\n")
    with pytest.raises(ConfigError) as caught:
        load_task(str(path))
    for entry in KINDS:
        assert entry.name in str(caught.value)
    assert len({entry.name for entry in KINDS}) == len(KINDS)
    page = (TOP / "docs/tasks.md").read_text()
    assert "{table-of} besman.simulation.tasks.kinds:KINDS" in page


def test_every_file_of_a_task_is_of_a_kind():
    kinds = {
        re.search(r"^kind: *(\w+)", path.read_text(), re.MULTILINE)[1]
        for path in (TOP / "configs/tasks").glob("*.yaml")
    }
    assert kinds == {entry.name for entry in (*KINDS, *WHOLE_KINDS)}


def test_every_class_of_the_folder_is_entered():
    """A kind that nobody entered is found: a task whose `simulate` is there."""
    folder = TOP / "besman/simulation/tasks"
    found = set()
    for path in folder.rglob("*.py"):
        parts = path.relative_to(TOP).with_suffix("").parts
        for thing in vars(import_module(".".join(parts))).values():
            if isinstance(thing, type) and issubclass(thing, Task):
                found |= {thing} if thing.simulate is not Task.simulate else set()
    assert found == {entry.load() for entry in KINDS}


@EVERY
def test_a_movement_has_an_outcome(entry):
    case = case_of(entry.name)
    (trial,) = case.try_out(paths=True)
    assert trial.failure == ""
    assert np.isfinite(trial.outcome).all()
    assert 0 <= trial.miss < 0.5
    assert trial.reward == pytest.approx(-sum(trial.costs.values()))
    assert np.isfinite(trial.reward)
    # Every measure has a weight of its own.
    assert {name.rpartition("_")[0] for name in trial.measures} <= {
        name.rpartition("_per_")[0] for name in trial.costs
    }
    assert case.task.succeeds(0.0, dict.fromkeys(trial.measures, 0.0))
    assert not case.task.succeeds(10.0, dict.fromkeys(trial.measures, 0.0))


@EVERY
def test_the_residual_is_a_success_where_the_task_is_one(entry):
    """Its norm says what `succeeds` says of the miss; empty if the kind only succeeds or not."""
    case = case_of(entry.name)
    moves = case.task.move([case.plan], case.robot)
    episodes = case.task.simulate(case.robot, [case.plan], moves, False)
    (trial,) = case.try_out()
    residual = case.task.residual(case.plan, episodes, 0)
    np.testing.assert_array_equal(trial.residual, residual)
    assert residual.shape == (RESIDUALS.get(entry.name, residual.size),)
    if not len(residual):
        return
    assert np.isfinite(residual).all()
    for off, hits in ((0.0, True), (0.9, True), (1.5, False)):
        moved = episodes.outcomes.copy()
        moved[0] = case.task.target(case.plan)
        moved[0] = moved[0] + off * case.task.success_radius_m * away_of(case)
        elsewhere = replace(episodes, outcomes=moved)
        elsewhere.end_poses[0, 3:] = case.plan.goal_pose[3:]
        miss = case.task.miss(case.plan, moved[0])
        norm = np.linalg.norm(case.task.residual(case.plan, elsewhere, 0))
        assert norm == pytest.approx(miss / case.task.success_radius_m, abs=1e-6)
        measures = case.task.measure(case.plan, elsewhere, 0)
        assert case.task.succeeds(miss, measures) == hits == (norm <= 1.0)


def away_of(case):
    """Return a direction in which an outcome is worse."""
    if case.task.kind != "pull_lever":
        return np.array([0.6, 0.8, 0.0])
    back = case.task.hinge(case.plan)
    angle = np.radians(case.task.lever.pull_deg)
    return -(back.axes @ np.array([-np.sin(angle), np.cos(angle), 0.0]))


@EVERY
def test_a_movement_is_what_it_would_be_alone(entry):
    case = case_of(entry.name)
    (alone,) = case.try_out()
    slower = replace(case.plan, duration=1.2 * case.plan.duration)
    batch = case.try_out(slower, case.plan, slower, *[case.plan] * 7, jobs=2)
    for trial in (batch[1], *batch[3:]):
        assert_same(trial, alone)
    assert_same(batch[0], batch[2])


@EVERY
def test_a_movement_that_is_no_number_is_one_failed_episode(entry):
    case = case_of(entry.name)
    plans = [case.plan, case.plan]
    moves = case.task.move(plans, case.robot)
    wild = moves.positions.copy()
    wild[0, 100:] = np.nan
    broken = Movements(
        wild, moves.velocities, moves.accelerations, moves.durations, ends=moves.ends
    )
    episodes = case.task.simulate(case.robot, plans, broken, False)
    assert episodes.failures == ("unstable simulation", "")
    assert np.isnan(episodes.outcomes[0]).all()


@EVERY
def test_limits_hold(entry):
    case, (motion,) = case_of(entry.name), motions_of(entry.name)
    limits = check_limits(case.robot, motion.positions, motion.velocities, motion.accelerations)
    assert motion.success
    assert limits.violations == limits.self_collisions == 0
    figures = refine_results((motion,), case.task)
    assert (figures["n_motions"], figures["n_success"]) == (1, 1)
    # Half a turn beyond a joint's range is no success, whatever comes of it.
    beyond = case.robot.limits.position_max[-1] + np.pi - case.plan.goal[-1]
    goal = case.plan.goal + beyond * (np.arange(case.robot.n) == case.robot.n - 1)
    (trial,) = case.try_out(replace(case.plan, goal=goal))
    assert trial.failure
    assert not trial.success
    assert trial.reward < motion.returns.max()


@EVERY
def test_perturbed_models_are_tried(entry):
    case = case_of(entry.name)
    off = [draw_perturbation(Spreads(), case.robot, (seed,)) for seed in (0, 1)]
    one, two = try_perturbed(case.robot, case.task, case.plan, off)
    assert one.reward != two.reward
    assert np.isfinite([one.reward, two.reward]).all()


@EVERY
def test_a_template_is_learnt_and_applied(entry):
    case, motions = case_of(entry.name), motions_of(entry.name)
    lesson = prepare_lesson(motions, case.robot, case.task, (), {}, TEACH)
    template = teach(lesson, TEACH, ("robot", case.task.tool, entry.name))
    np.testing.assert_array_equal(template.tries.contexts.shape, (10, 2))
    assert np.isfinite(template.tries.rewards).all()
    # What was refined is in the middle, where the policy began.
    context = lesson.kind.of(motions[0].plan, lesson.family.names)
    applied = apply_template(template, case.robot, case.task, context)
    assert applied.limits.violations == applied.limits.self_collisions == 0
    np.testing.assert_allclose(lesson.kind.of(applied.plan, lesson.family.names), context)
    assert np.isfinite(applied.forecast.reward)
    assert 0 <= applied.forecast.success <= 1


@EVERY
def test_a_template_is_refused_with_a_reason(entry):
    """Where a setting of the task says where its things are, no context can."""
    case = case_of(entry.name)
    shipped = load_task(entry.name)
    if shipped.fixed_by:
        with pytest.raises(RefinementError, match=f"task {entry.name}: {shipped.fixed_by} fixes"):
            context_kind(shipped)
    nowhere = replace(motions_of(entry.name)[0].plan, **{
        name: np.full_like(getattr(case.plan, name), np.nan) for name in case.task.placed_by
    })  # fmt: skip
    motion = replace(motions_of(entry.name)[0], plan=nowhere)
    with pytest.raises(RefinementError, match=r"is placed by .* of a motion; a\S* has none"):
        prepare_lesson((motion,), case.robot, case.task, (), {}, TEACH)


@EVERY
def test_report_and_view_show_it(entry, monkeypatch):
    # Where a figure's parts are placed is nothing of the task, and half of the time.
    monkeypatch.setattr("besman.report.figures._settle_layout", lambda figure: None)
    case, motions = case_of(entry.name), motions_of(entry.name)
    (motion,) = motions
    poses = forward_kinematics(case.robot.chain, motion.positions)
    mapped = JointTrajectory(
        time=motion.time,
        positions=motion.positions,
        velocities=motion.velocities,
        accelerations=motion.accelerations,
        joint_names=case.robot.joint_names,
        poses=np.column_stack([poses[:, :3, 3], rotation_to_quaternion(poses[:, :3, :3])]),
        position_error=np.zeros(len(poses)),
        orientation_error=np.zeros(len(poses)),
        time_stretch=1.0,
        target=motion.plan.target,
        name=motion.plan.name,
        label="x",
    )
    mapping = Mapping((mapped,), np.eye(4), (), {}, 0, 0)
    arm = ArmRecords("", "", {}, "right", mapping, motions)
    page = motion_sections(arm, {"refine": refine_results(motions, case.task)})
    assert "Refinement in simulation" in page
    assert page.count("<svg") >= 7
    within = DemonstrationInPlan(0.0, 0.0, float(motion.time[-1]))
    takes = simulated_takes(motion, within, case.robot, case.task, 20.0)
    assert takes[-1].episode == motion.milestones[-1][0]
    assert takes[-1].success
    assert takes[-1].joints.shape[1] == case.robot.n
    packer = Packer()
    assert len(packer.bundle({"takes": [take.content(packer) for take in takes]})) > 500
