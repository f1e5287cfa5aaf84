import json
import sys

import pytest

from besman.cli.main import main
from besman.config.resources import resource_folder
from besman.exceptions import ConfigError, RecognitionError
from besman.pipeline.check import check_pipeline
from besman.pipeline.config import load_pipeline
from besman.stages.recognize.model_files import load_model
from besman.standalone.train_files import train_files


@pytest.fixture(scope="module")
def sample():
    return resource_folder("data") / "stick_throw"


def test_recordings_and_segments_files_teach_the_same(sample, tmp_path):
    one, _ = train_files([sample / "subject1.tsv"], tmp_path / "one", "right_arm", ())
    path = sample / "subject1_manually_segmented.json"
    two, _ = train_files([path], tmp_path / "two", "right_arm", ())
    assert one.read_bytes() == two.read_bytes()


def test_the_command_writes_a_model(sample, tmp_path, monkeypatch, capsys):
    arguments = ["besman", "train", str(sample), "--out", str(tmp_path / "m"), "--set", "seed=3"]
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as stop:
        main()
    assert not stop.value.code
    said, labels = capsys.readouterr().out, load_model(tmp_path / "m").labels
    assert "m.npz" in said
    assert f"throw {labels.count('throw')}" in said
    assert labels.count("throw") > 1
    assert json.loads((tmp_path / "m.json").read_text())["recordings"] == [
        "subject1.tsv",
        "subject2.tsv",
    ]


def test_a_check_takes_a_model_in_place_of_examples(sample, tmp_path):
    train_files([sample], tmp_path / "m", "right_arm", ())
    bare = tmp_path / "bare"
    bare.mkdir()
    (bare / "a.tsv").write_bytes((sample / "subject1.tsv").read_bytes())
    settings = (f"recordings={bare}", f"recognize.model={tmp_path / 'm'}")
    (line,) = [one for one in check_pipeline("ur5_stick_throw", settings) if "model:" in one]
    labels = load_model(tmp_path / "m").labels
    assert f"throw {labels.count('throw')}" in line
    with pytest.raises(
        ConfigError, match=r"select.label: got 'thrw', which is no class of .*throw"
    ):
        check_pipeline("ur5_stick_throw", (*settings, "select.label=thrw"))
    with pytest.raises(RecognitionError, match=r"nomodel\.json: cannot be read"):
        check_pipeline("ur5_stick_throw", (settings[0], "recognize.model=/nomodel"))


def test_settings_are_checked(sample, tmp_path):
    with pytest.raises(ConfigError, match="--set: got 'hmm', expected KEY=VALUE"):
        train_files([sample], tmp_path / "m", "right_arm", ("hmm",))
    with pytest.raises(ConfigError, match="which is not a YAML value"):
        train_files([sample], tmp_path / "m", "right_arm", ("seed=[",))
    with pytest.raises(ConfigError, match=r"recognize.method: got 'knn'; allowed: dtw, hmm, lstm"):
        train_files([sample], tmp_path / "m", "right_arm", ("method=knn",))


def test_what_teaches_nothing_is_refused(sample, tmp_path):
    (tmp_path / "a.tsv").write_bytes((sample / "subject1.tsv").read_bytes())
    with pytest.raises(RecognitionError, match="nothing is labelled; expected STEM_manually_segm"):
        train_files([tmp_path / "a.tsv"], tmp_path / "m", "right_arm", ())
    (tmp_path / "b_manually_segmented.json").write_text("[]")
    with pytest.raises(RecognitionError, match="no recording beside this segments file"):
        train_files([tmp_path / "b_manually_segmented.json"], tmp_path / "m", "right_arm", ())


def test_a_pipeline_finds_its_model(tmp_path):
    text = (resource_folder("pipelines") / "ur5_stick_throw.yaml").read_text()
    (tmp_path / "p.yaml").write_text(text.replace("recognize:\n", "recognize:\n  model: m.npz\n"))
    config = load_pipeline(tmp_path / "p.yaml")
    assert config.recognize.model == str(tmp_path / "m.npz")
    assert load_pipeline(tmp_path / "p.yaml", ("recognize.model=/x/m",)).recognize.model == "/x/m"
