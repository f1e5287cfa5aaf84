"""Templates in simulation, from a run's refined motions to files for the arm."""

import json
from dataclasses import replace

import numpy as np
import pytest

from besman.cli import main as cli
from besman.config.stage import Work
from besman.exceptions import PlanError, RefinementError, RunError
from besman.geometry.frames import rotation_to_quaternion
from besman.io.exports import read_joint_csv, read_ros_joint_trajectory
from besman.io.urscript import read_urscript
from besman.motion.rollout import sample_plan
from besman.pipeline.config import PipelineConfig, pipeline_yaml
from besman.pipeline.finished_run import read_run
from besman.records.files import save_record
from besman.robot.dynamics import inverse_dynamics
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.robot.model import load_robot
from besman.search.upper_level import UpperLevelPolicy
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.refine.stage import CmaEsConfig
from besman.templates import files
from besman.templates.applying import apply_template
from besman.templates.contexts import context_kind
from besman.templates.files import learn_in_run, load_template, write_application
from besman.templates.learning import TemplateConfig, Tries
from besman.templates.teaching import prepare_lesson, teach
from besman.templates.template import Template, forecast, slow_to_torque

THROW = load_task("stick_throw")
QUICK = TemplateConfig(method="c_reps", episodes=40, population=20, checks=10)


@pytest.fixture(scope="module")
def motions(robot, make_plan):
    """A throw that hits, because its target is where it lands, and one that misses by far."""
    plan = make_plan(0.54, name="session.tsv:1")
    (trial,) = try_plans(robot, THROW, [plan])
    plans = (
        replace(plan, target=trial.outcome),
        replace(plan, target=trial.outcome + np.array([3.0, 0, 0]), name="session.tsv:2"),
    )
    return CmaEsConfig(episodes=1).run(plans, robot, THROW)


@pytest.fixture(scope="module")
def run(motions, tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("template") / "run", motions)


@pytest.fixture(scope="module")
def template(run):
    return learn_in_run(run, (), {}, QUICK)[0]


def make_run(folder, motions):
    """Write what templates read of a run."""
    (folder / "08_refine").mkdir(parents=True)
    config = PipelineConfig(
        name="run",
        recordings=("a.tsv",),
        robot="ur5",
        tool="stick_holder",
        task="stick_throw",
        select={"label": "throw"},
    )
    (folder / "pipeline.yaml").write_text(pipeline_yaml(config))
    save_record(motions, folder / "08_refine" / "record.npz")
    return folder


def test_the_region_lies_around_what_succeeded(robot, motions):
    lesson = prepare_lesson(motions, robot, THROW, (), {"y": (-1.0, 0.5)}, QUICK)
    target = motions[0].plan.target
    np.testing.assert_allclose(lesson.region[:, 0], target[0] + np.array([-0.4, 0.4]))
    np.testing.assert_allclose(lesson.region[:, 1], [-1.0, 0.5])
    assert lesson.family.base.name == "session.tsv:1"


def test_threads_and_a_kill_change_nothing(run, template, monkeypatch, tmp_path, motions):
    other = make_run(tmp_path / "run", motions)
    kept = []

    def stop(*arguments):
        keep(*arguments)
        kept.append(arguments)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        keep = files._keep
        patch.setattr(files, "_keep", stop)
        with pytest.raises(KeyboardInterrupt):
            learn_in_run(other, (), {}, QUICK)
    assert len(kept) == 1
    assert not (other / "templates" / "c_reps.json").exists()
    shares = []
    again, path = learn_in_run(other, (), {}, QUICK, Work(3, shares.append))
    assert path.read_bytes() == (run / "templates" / "c_reps.npz").read_bytes()
    assert sorted(file.name for file in path.parent.iterdir()) == ["c_reps.json", "c_reps.npz"]
    np.testing.assert_array_equal(again.policy.gain, template.policy.gain)
    assert shares[-1] == 1.0
    # The same once more is loaded, another one is learnt.
    before = path.stat().st_mtime_ns
    learn_in_run(other, (), {}, QUICK)
    assert path.stat().st_mtime_ns == before
    learn_in_run(other, (), {}, QUICK.model_copy(update={"seed": 1}))
    assert path.stat().st_mtime_ns != before


def test_a_motion_keeps_all_limits_and_is_what_was_learnt(robot, template):
    for context in np.random.default_rng(0).uniform(*template.region, (5, 2)):
        applied = apply_template(template, robot, THROW, context)
        movement = applied.positions, applied.velocities, applied.accelerations
        report = check_limits(robot, *movement)
        assert report.violations == report.self_collisions == 0
        torques = inverse_dynamics(robot, *movement)
        assert (np.abs(torques) <= robot.limits.torque).all()
        np.testing.assert_allclose(np.diff(applied.time), 1e-3)
        np.testing.assert_array_equal(applied.plan.target, [*context, 0.0])
        assert not any("outside" in warning for warning in applied.warnings)


def test_a_check_does_again_what_it_did(robot, template):
    checks, family = template.checks, template.family
    context, point = checks.contexts[3:4], checks.points[3:4]
    (learnt,) = family.plans(robot, context_kind(THROW), point, context)
    learnt = THROW.place(learnt, robot)
    applied = apply_template(template, robot, THROW, context[0]).plan
    again, slower = (try_plans(robot, THROW, [plan])[0] for plan in (learnt, applied))
    assert again.miss == pytest.approx(checks.misses[3], abs=1e-6)
    # Limits are looked at more finely than in a check, which may slow the throw down by a hair.
    assert 1.0 <= applied.duration / learnt.duration < 1.01
    np.testing.assert_allclose(applied.weights, learnt.weights, rtol=1e-9)
    assert slower.miss == pytest.approx(again.miss, abs=5e-3)


def test_a_context_outside_is_warned_of(robot, template):
    low, high = template.region
    applied = apply_template(template, robot, THROW, [high[0] + 0.1, low[1] - 0.25])
    (warning,) = [one for one in applied.warnings if "outside" in one]
    assert "outside the region that was learnt: x: got" in warning
    assert "(outside by 0.1 m); y: got" in warning
    assert "(outside by 0.25 m)" in warning


def test_a_context_out_of_all_reach_is_an_error(robot, template):
    # Whatever was learnt, this one ends with the elbow folded: no duration lets it reach.
    base = replace(template.family.base, goal=np.array([0.0, -1.5, 3.1, 0.0, 0.0, 0.0]))
    policy = replace(template.policy, gain=np.zeros_like(template.policy.gain))
    folded = replace(template, family=replace(template.family, base=base), policy=policy)
    why = r"the arm would touch itself, its pedestal or the floor in \d+ of \d+ samples"
    with pytest.raises(PlanError, match=why + "; outside the region that was learnt: x"):
        apply_template(folded, robot, THROW, template.region[1] + [1.0, 0.0])


def test_a_joint_beyond_its_limit_is_an_error(robot, template):
    start = template.family.base.start
    tight = replace(robot, limits=replace(robot.limits, position_max=start - 0.1))
    with pytest.raises(PlanError, match=r"joint .* rad, expected it within .*"):
        apply_template(template, tight, THROW, template.region[1])


def test_a_context_of_another_size_is_an_error(robot, template):
    with pytest.raises((RefinementError, ValueError), match="shape"):
        apply_template(template, robot, THROW, [1.0, 2.0, 3.0])
    with pytest.raises(RefinementError, match="contexts must be finite"):
        apply_template(template, robot, THROW, [1.0, np.nan])


def test_torque_makes_a_plan_slow(robot, make_plan):
    plan = make_plan(0.54)
    assert slow_to_torque(plan, robot) is plan
    _, *movement = sample_plan(plan, robot)
    q = movement[0]
    holding = inverse_dynamics(robot, q, np.zeros_like(q), np.zeros_like(q))
    # Twenty Newton metres more than what holds the arm.
    torque = np.abs(holding).max(axis=0) + 20.0
    weak = replace(robot, limits=replace(robot.limits, torque=torque))
    slow = slow_to_torque(plan, weak)
    load = np.abs(inverse_dynamics(weak, *sample_plan(slow, weak)[1:])) / torque
    assert slow.duration > plan.duration
    assert 0.98 < load.max() <= 1.0


def made_up(contexts, rewards, misses):
    """A template with these checks, in the region [-1, 1]^2."""
    n = len(contexts)
    tries = Tries(contexts, np.zeros((n, 1)), rewards, misses, misses < 0.1)
    policy = UpperLevelPolicy(np.zeros((1, 3)), np.eye(1), "affine", np.zeros(2), np.ones(2))
    region = np.array([[-1.0, -1.0], [1.0, 1.0]])
    return Template("c_reps", "r", "t", "k", None, region, policy, tries, tries)


def test_forecasts_are_weighted_means():
    random = np.random.default_rng(0)
    contexts, rewards = random.uniform(-1, 1, (30, 2)), random.normal(size=30)
    misses = np.where(np.arange(30) % 7 == 0, np.nan, np.abs(rewards))
    made = made_up(contexts, rewards, misses)
    for context in ([0.0, 0.0], [0.9, -0.4], [5.0, 5.0]):
        squares = [float(np.sum((np.array(context) - one) ** 2)) for one in contexts]
        weights = [np.exp(-0.5 * (one - min(squares)) / 0.3**2) for one in squares]
        mean = sum(w * r for w, r in zip(weights, rewards, strict=True)) / sum(weights)
        square = sum(w * (r - mean) ** 2 for w, r in zip(weights, rewards, strict=True))
        found = forecast(made, context)
        assert found.reward == pytest.approx(mean)
        assert found.reward_spread == pytest.approx(np.sqrt(square / sum(weights)))
        assert 0.0 <= found.success <= 1.0
        assert np.isfinite(found.miss)


def test_where_everything_failed_no_miss_is_forecast():
    made = made_up(np.zeros((3, 2)), np.full(3, -5.0), np.full(3, np.nan))
    found = forecast(made, [0.1, 0.1])
    assert np.isnan(found.miss)
    assert (found.reward, found.success) == (pytest.approx(-5.0), 0.0)


def test_files_hold_the_motion(robot, template, tmp_path):
    applied = apply_template(template, robot, THROW, template.region.mean(axis=0))
    paths = [tmp_path / f"a{ending}" for ending in (".csv", ".json", ".yaml", ".script")]
    write_application(applied, paths)
    for positions in (read_joint_csv(paths[0])[1], read_ros_joint_trajectory(paths[1])[1]):
        np.testing.assert_allclose(positions, applied.positions, atol=1e-8)
    held = read_ros_joint_trajectory(paths[2])[1]
    np.testing.assert_allclose(held, applied.positions, atol=1e-8)
    _, held = read_urscript(paths[3])
    np.testing.assert_allclose(held[:-1], applied.positions[::8][: len(held) - 1], atol=1e-6)
    with pytest.raises(RunError, match=r"--out: .*a\.csv exists; give a new name"):
        write_application(applied, paths[:1])
    with pytest.raises(RefinementError, match=r"--out: got .*a\.txt, expected a file that ends in"):
        write_application(applied, [tmp_path / "a.txt"])
    with pytest.raises(RunError, match="there is no folder"):
        write_application(applied, [tmp_path / "none" / "a.csv"])
    other = replace(applied, plan=replace(applied.plan, joint_names=tuple("abcdef")))
    with pytest.raises(RefinementError, match=r"ends in \.csv, \.json, \.yaml$"):
        write_application(other, [tmp_path / "b.script"])


def test_a_run_without_what_is_needed_says_so(tmp_path, motions, run):
    with pytest.raises(RunError, match=r"not a run: pipeline\.yaml is missing"):
        read_run(tmp_path)
    unfinished = make_run(tmp_path / "unfinished", motions)
    (unfinished / "08_refine" / "record.npz").unlink()
    with pytest.raises(RunError, match="no refined motions here: expected a finished run"):
        learn_in_run(unfinished, (), {}, QUICK)
    failed = make_run(tmp_path / "failed", motions[1:])
    with pytest.raises(RefinementError, match="none of the run's 1 refined motions succeeds"):
        learn_in_run(failed, (), {}, QUICK)
    with pytest.raises(RunError, match=r"no template here \(there: none\); expected one from besm"):
        load_template(failed)
    with pytest.raises(RunError, match=r"no template c_cma_es here \(there: c_reps\)"):
        load_template(run, "c_cma_es")


def test_of_several_templates_one_is_named(tmp_path, template, motions):
    folder = make_run(tmp_path / "run", motions) / "templates"
    folder.mkdir()
    for name in ("c_reps", "c_cma_es"):
        save_record(template, folder / f"{name}.npz")
        (folder / f"{name}.json").write_text("{}")
    with pytest.raises(
        RunError, match="several templates: c_cma_es, c_reps; say which with --method"
    ):
        load_template(folder.parent)
    assert load_template(folder.parent, "c_reps").robot == "ur5"
    # A file without its figures was not finished.
    (folder / "c_cma_es.json").unlink()
    assert load_template(folder.parent).method == template.method


def call(monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", ["besman", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    return stop.value.code or 0


def test_the_commands(run, template, monkeypatch, tmp_path, capsys):
    options = "--method", "c_reps", "--episodes", 40, "--set", "population=20", "--set", "checks=10"
    assert call(monkeypatch, "template", "learn", run, *options) == 0
    told = capsys.readouterr().out
    assert "learnt x " in told
    assert "in 40 episodes; 10 further contexts" in told
    assert call(monkeypatch, "template", "learn", run, "--episodes", 0) == 2
    assert "template: episodes" in capsys.readouterr().err
    assert call(monkeypatch, "template", "learn", run, "--context", "x,r") == 2
    assert "context: got 'r'; " in capsys.readouterr().err
    # Little is learnt in 40 episodes: just outside of the region, motions still are fit to run.
    x, y = template.region[1] + 0.02
    out, told = tmp_path / "throw.csv", tmp_path / "throw.info"
    context = f"x={x:.3f},y={y:.3f}"
    assert (
        call(
            monkeypatch,
            "template",
            "apply",
            run,
            "--context",
            context,
            "--out",
            out,
            "--json",
            told,
        )
        == 0
    )
    printed = capsys.readouterr()
    assert "besman: warning: outside the region that was learnt: x" in printed.err
    assert "predicted reward" in printed.out
    content = json.loads(told.read_text())
    assert content["limits"]["velocity"] == content["limits"]["self_collisions"] == 0
    time = read_joint_csv(out)[0]
    assert time[-1] == pytest.approx(content["duration_s"])
    assert call(monkeypatch, "template", "apply", run, "--context", "x=1") == 2
    assert "--context: got 'x=1', y missing" in capsys.readouterr().err


@pytest.mark.slow
def test_unseen_targets_are_hit_by_a_thrown_stick(robot, motions):
    config = TemplateConfig(method="c_reps", episodes=400, checks=20)
    lesson = prepare_lesson(motions, robot, THROW, (), {}, config)
    template = teach(lesson, config, ("ur5", "stick_holder", "stick_throw"), Work(2))
    contexts = np.random.default_rng(7).uniform(*template.region, (20, 2))
    plans = [apply_template(template, robot, THROW, context).plan for context in contexts]
    misses = [trial.miss for trial in try_plans(robot, THROW, plans)]
    assert np.median(misses) < 0.1


@pytest.mark.slow
def test_an_object_is_reached_wherever_it_stands(make_plan):
    gripper, reach = load_robot("ur5", "gripper"), load_task("reach")
    plan = make_plan(0.8)
    pose = forward_kinematics(gripper.chain, plan.goal)
    end = np.concatenate([pose[:3, 3], rotation_to_quaternion(pose[:3, :3])])
    plan = replace(plan, goal_pose=end, target=np.full(3, np.nan))
    motions = CmaEsConfig(episodes=1).run((plan,), gripper, reach)
    config = TemplateConfig(method="c_reps", episodes=800, checks=20, search=("goal",), sigma=0.5)
    lesson = prepare_lesson(motions, gripper, reach, ("x", "y"), {}, config)
    np.testing.assert_allclose(np.ptp(lesson.region, axis=0), 0.1)
    template = teach(lesson, config, ("ur5", "gripper", "reach"))
    assert np.nanmedian(template.checks.misses) < 0.01
