"""The README's lines for throws of your own, whether their trajectories have names or not."""

import json

import pytest

from besman.config.resources import find_resource
from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.standalone.train_files import train_files
from besman.synthetic.cameras import Room
from besman.synthetic.datasets import write_synthetic


@pytest.mark.parametrize("named", [True, False])
def test_own_throws_with_and_without_names(named, tmp_path):
    folder = tmp_path / "throws"
    room = None if named else Room()
    write_synthetic("stick_throw", folder, n_subjects=1, n_repetitions=2, room=room)
    train_files([folder], tmp_path / "model", "right_arm", ())
    settings = (
        f"recordings={folder}",
        f"recognize.model={tmp_path / 'model'}",
        "map.evaluations=2",
        "map.yaw=false",
        "refine.episodes=1",
        "refine.robustness=null",
    )
    config = load_pipeline(find_resource("pipelines", "ur5_stick_throw"), settings)
    run_pipeline(config, tmp_path / "run")
    results = json.loads((tmp_path / "run" / "results.json").read_text())
    counts = {"taken": 9, "found": 0} if named else {"taken": 0, "found": 9}
    assert results["label"]["names"] == [{"recording": "subject1.tsv", **counts}]
    assert results["refine"]["n_motions"] == 2
