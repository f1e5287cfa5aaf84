"""Pipelines that compose: a throw with its strike-out and swing-out as one action."""

import json

import numpy as np
import pytest
from small_runs import keep_demonstrations

from besman.cli import main as cli
from besman.config.resources import find_resource
from besman.exceptions import ConfigError, RefinementError
from besman.pipeline.check import check_pipeline
from besman.pipeline.check_run import check_run
from besman.pipeline.config import load_pipeline, pipeline_yaml
from besman.records.files import load_record
from besman.synthetic.datasets import write_synthetic

PARTS = ("strike_out", "throw", "swing_out")
COMPOSE = "compose={levels: [[toss]], examples_per_class: 2}"


def run(monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", ["besman", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    return caught.value.code or 0


@pytest.mark.slow
def test_an_action_is_retargeted(toss_run):
    run = toss_run / "run"
    (place,) = run.glob("*_compose")
    (actions,) = load_record(place / "record.npz")
    level = actions.levels[0]
    assert set(level.labels) == {"toss"}
    assert np.all(level.bounds[1:, 0] == level.bounds[:-1, 1])
    (place,) = run.glob("*_select")
    assert {one.label for one in load_record(place / "record.npz")} == {"toss"}
    found = json.loads((run / "results.json").read_text())
    assert found["compose"]["levels"][0]["counts"]["toss"] == len(level.labels)
    assert "toss" not in found["recognize"]["counts"]
    assert "Actions made of building blocks" in (run / "report.html").read_text()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (("select.action=toss",), "expected one of label and action, got both"),
        (("select.label=null",), "expected one of label and action, got none"),
        (("select.label=null", "select.action=toss"), "'toss'; allowed: nothing"),
        (("select.label=null", "select.action=tos", COMPOSE), "did you mean 'toss'"),
        (
            (
                "select.label=null",
                "select.action=toss",
                "select.as=blocks",
                "second_arm={robot: ur5, tool: none}",
            ),
            "blocks are those of one arm; expected no second_arm",
        ),
        (("select.as=blocks",), "expected action: NAME in place of label"),
        (("compose={levels: []}",), "levels"),
        (("compose={levels: [[]]}",), "at least 1 item"),
    ],
)
def test_refuses(settings, message):
    with pytest.raises(ConfigError, match=message):
        load_pipeline(find_resource("pipelines", "ur5_stick_throw"), settings)


TOSS = ("select.label=null", "select.action=toss", "select.as=blocks")


def test_a_sequence_is_checked_before_it_runs():
    config = load_pipeline(
        find_resource("pipelines", "ur5_stick_throw"),
        (*TOSS, "select.actions={toss: [strike_out, throw, swing_out]}"),
    )
    assert config.select.actions == {"toss": PARTS}
    assert "as: blocks" in pipeline_yaml(config)
    assert any("labelled examples" in line for line in check_pipeline(
        "ur5_stick_throw", (*TOSS, "select.actions={toss: [strike_out, throw, swing_out]}")
    ))  # fmt: skip
    with pytest.raises(ConfigError, match=r"actions.toss: got 'trow', .*did you mean 'throw'"):
        check_pipeline("ur5_stick_throw", (*TOSS, "select.actions={toss: [strike_out, trow]}"))


def test_a_whole_task_of_a_single_movement_is_refused_before_it_runs():
    whole = ("tool=gripper3", "task=rearrange")
    with pytest.raises(ConfigError, match=r"is one of whole actions; expected select\.as: blocks"):
        check_pipeline("ur5_pick_and_place", (*whole, "select.as=movement"))
    lines = check_pipeline("ur5_pick_and_place")
    assert lines[-1] == "task: rearrange, success within 2 cm and 10 degrees"
    with pytest.raises(RefinementError, match="carries tool 'gripper', expected 'gripper3'"):
        check_pipeline("ur5_pick_and_place", ("tool=gripper",))


@pytest.mark.slow
def test_a_whole_task_runs_from_the_recording_to_its_files(monkeypatch, tmp_path, undrawn):
    """A person puts a box on a table and back (synthetic)."""
    keep_demonstrations(monkeypatch, 1)
    write_synthetic("pick_and_place", tmp_path / "capture", 1, 2, seed=3)
    blocks = ("approach_forward", "move_obj_table", "move_to_rest_right")
    settings = (
        "label={method: named}", "recognize.examples_per_class=2", "select.label=null",
        "select.action=to_table", "select.as=blocks", "select.merge=false",
        f"select.actions={{to_table: [{', '.join(blocks)}]}}", "map.evaluations=40",
        "map.yaw=false", "tool=gripper3", "task=rearrange",
    )  # fmt: skip
    arguments = [part for one in settings for part in ("--set", one)]
    folder = tmp_path / "run"
    run(
        monkeypatch, "run", "ur5_reach", "--out", folder,
        "--set", f"recordings={tmp_path / 'capture'}", *arguments,
    )  # fmt: skip
    found = json.loads((folder / "results.json").read_text())
    assert found["actions"]["counts"]["to_table"] == 2
    for own in found["blocks"]["demonstrations"].values():
        assert tuple(own["blocks"]) == blocks
        assert [hold["grasp_in"] for hold in own["holds"]] == ["move_obj_table"]
    assert found["simulate"]["n_tasks"] == found["refine_tasks"]["n_tasks"] >= 1
    assert found["refine_tasks"]["n_success"] >= found["simulate"]["n_success"]
    assert not {"imitate", "refine"} & set(found)
    assert "whole tasks, refined: " in (folder / "report.html").read_text()
    assert found["tasks"]["n_tasks"] == len(found["task_plans"]["plans"]) >= 1
    for name in found["refine_tasks"]["trials"]:
        stem = f"{name.split('.')[0]}_{name.rpartition(':')[2]}"
        assert (folder / "exports_tasks" / f"{stem}.gripper.csv").is_file()
    whole, faults = check_run(folder)
    assert faults == []
    assert any(line.startswith("exports: ") for line in whole)
