import json

import pytest
from small_runs import keep_demonstrations

from besman.config.resources import find_resource
from besman.exceptions import ConfigError
from besman.pipeline.check import check_pipeline
from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline

RECIPES = ("compi_ball_throw", "iiwa7_grasp", "ur10_lever")
# What takes time and shows nothing here: a second person, many placements, and more models; of a
# grasp, which is simulated longest, the search in many worlds is in the contract of the tasks.
LESS = {
    "ur10_lever": (f"recordings={find_resource('data/lever', 'subject1', '.tsv')}",),
    "iiwa7_grasp": ("refine.robust=null",),
}
FEW = ("refine.robustness={models: 2}", "map.evaluations=20", "map.yaw=false")
# Of the demonstrations that are found, so many go on to the robot.
FOUND = {"compi_ball_throw": (8, 2), "iiwa7_grasp": (3, 1), "ur10_lever": (3, 2)}


@pytest.mark.parametrize("name", RECIPES)
def test_recipes_of_the_tasks_are_complete(name):
    lines = check_pipeline(name)
    assert lines[-1].startswith("task: ")
    assert "made for" not in lines[-1]


def test_another_kind_of_motion_plan_than_the_tasks_is_told():
    (line,) = check_pipeline("ur10_lever", ("imitate.method=cartesian_dmp",))[-1:]
    assert line.endswith("success within 2 cm; made for joint_dmp, imitated by cartesian_dmp")


def test_a_budget_of_zero_is_an_error():
    path = find_resource("pipelines", "ur10_lever")
    with pytest.raises(ConfigError, match=r"refine.episodes: got 0; input should be greater than"):
        load_pipeline(path, ("refine.episodes=0",))


@pytest.mark.slow
@pytest.mark.parametrize("name", RECIPES)
def test_from_unnamed_markers_to_refined_motions(name, tmp_path, monkeypatch, undrawn):
    n_found, n_kept = FOUND[name]
    found = keep_demonstrations(monkeypatch, n_kept)
    config = load_pipeline(find_resource("pipelines", name), (*FEW, *LESS.get(name, ())))
    run_pipeline(config, tmp_path / name, jobs=2)
    assert len(found) == n_found
    results = json.loads((tmp_path / name / "results.json").read_text())
    assert results["label"]["right_share"] > 0.99
    refine = results["refine"]
    assert refine["n_motions"] == results["map"]["n_demonstrations"] == n_kept
    assert refine["n_success"] == n_kept
    assert len(list((tmp_path / name / "exports").glob("*[0-9].csv"))) == n_kept
