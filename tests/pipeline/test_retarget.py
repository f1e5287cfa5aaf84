"""New demonstrations for several robots: what is to be done, and what is said if it fails."""

import sys
from pathlib import Path

import pytest

from besman.cli import main
from besman.exceptions import ConfigError, RobotError, RunError
from besman.pipeline import retarget
from besman.pipeline.retarget import (
    RetargetPlan,
    plan_retargeting,
    raise_failures,
    retarget_robots,
)
from besman.work.outcome import describe_error

FILE = Path("new.tsv")


def test_a_recipe_is_the_runs_own_for_other_recordings(small_run):
    (plan,) = plan_retargeting(small_run, [FILE], (), None)
    assert plan.name == "ur5"
    assert plan.folder == small_run.with_name(f"{small_run.name}_ur5_new")
    assert plan.config.recordings == (str(FILE.resolve()),)
    assert plan.config.training == ()
    assert plan.config.map.evaluations == 60


def test_several_robots_have_folders_of_their_own(small_run, tmp_path):
    plans = plan_retargeting(small_run, [FILE], ("ur10", "compi"), tmp_path)
    assert [plan.folder for plan in plans] == [tmp_path / "ur10", tmp_path / "compi"]
    assert [plan.config.robot for plan in plans] == ["ur10", "compi"]
    with pytest.raises(ConfigError, match="--robot: got 'ur10' twice; expected each robot once"):
        plan_retargeting(small_run, [FILE], ("ur10", "ur10"), None)
    with pytest.raises(RunError, match=r"not a run: pipeline\.yaml is missing"):
        plan_retargeting(tmp_path, [FILE], (), None)


def test_a_tool_may_be_another(small_run):
    (plan,) = plan_retargeting(small_run, [FILE], (), None, "scoop")
    assert (plan.config.robot, plan.config.tool) == ("ur5", "scoop")


def test_a_tool_is_refused_before_the_first_stage(tmp_path, monkeypatch, capsys):
    out = tmp_path / "run"
    for tool, message in (
        ("scoop", "task stick_throw: robot ur5 carries tool 'scoop', expected 'stick_holder'"),
        ("scop", "no tool 'scop'; did you mean 'scoop'"),
    ):
        arguments = ["besman", "run", "ur5_stick_throw", "--tool", tool, "--out", str(out)]
        monkeypatch.setattr(sys, "argv", arguments)
        with pytest.raises(SystemExit) as end:
            main.main()
        assert end.value.code == 2
        assert message in " ".join(capsys.readouterr().err.split())
        assert not list(out.glob("0*"))


def test_what_fails_for_one_robot_does_not_stop_the_others(monkeypatch):
    ran = []

    def run(config, folder, **options):
        ran.append(folder.name)
        if folder.name == "b":
            raise ZeroDivisionError("no\nreach")
        return folder

    monkeypatch.setattr(retarget, "run_pipeline", run)
    plans = tuple(RetargetPlan(name, None, Path(name)) for name in "abc")
    done = retarget_robots(plans, Path("run"))
    assert ran == ["a", "b", "c"]
    assert [one.error is None for one in done] == [True, False, True]
    with pytest.raises(RunError, match="1 of 3 robots failed: b: ZeroDivisionError: no reach"):
        raise_failures(done)
    with pytest.raises(ZeroDivisionError):
        raise_failures(done[1:2])
    raise_failures(done[:1])


def test_an_error_of_besmans_own_needs_no_name():
    assert describe_error(RobotError("far  away")) == "far away"
    assert describe_error(KeyError("a")) == "KeyError: 'a'"
