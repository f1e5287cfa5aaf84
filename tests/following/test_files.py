"""`besman follow`: what it finds in a recording is what the run found in it."""

import json
import sys

import numpy as np
import pytest

from besman.cli import main as cli
from besman.config.resources import resource_folder
from besman.exceptions import BesmanError, ConfigError, LabellingError, RunError
from besman.following.files import Replay
from besman.following.plans import make_plan
from besman.io.recordings.formats import read_recording, write_recording
from besman.records.files import load_record
from besman.standalone.train_files import train_files

SAMPLE = resource_folder("data") / "stick_throw" / "subject1.tsv"


def call(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["besman", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    return stop.value.code or 0


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path, _ = train_files([SAMPLE], tmp_path_factory.mktemp("model") / "m", "right_arm", ())
    return path


@pytest.fixture(scope="module")
def start_of_sample(tmp_path_factory):
    """The first seconds of the sample, with a gap; as a file of its own."""
    recording = read_recording(SAMPLE)
    n = round(9.0 * recording.rate_hz)
    positions = recording.positions[:n].copy()
    (elbow,) = [k for k, name in enumerate(recording.names) if "elbow" in name.lower()]
    positions[100:105, elbow] = np.nan
    path = tmp_path_factory.mktemp("start") / "start.tsv"
    changes = {"time": recording.time[:n], "positions": positions}
    write_recording(type(recording)(**{**vars(recording), **changes}), path)
    return path


@pytest.mark.slow
def test_a_run_is_followed_to_what_it_found_itself(monkeypatch, tmp_path, capsys, toss_run):
    run = toss_run / "run"
    (capture,) = (toss_run / "capture").glob("*.tsv")
    code = call(
        monkeypatch, "follow", capture, "--run", run, "--horizon", 0, "--json", tmp_path / "f.json"
    )
    lines = capsys.readouterr().out.splitlines()
    assert code == 0
    found = json.loads((tmp_path / "f.json").read_text())
    (place,) = run.glob("*_recognize")
    (blocks,) = load_record(place / "record.npz")
    (place,) = run.glob("*_compose")
    (actions,) = load_record(place / "record.npz")
    for pieces, expected in (
        (found["blocks"]["right"], blocks),
        (found["actions"][0], actions.levels[0]),
    ):
        frames = (expected.bounds + expected.first_frame).tolist()
        assert [piece["frames"] for piece in pieces] == frames
        assert [piece["label"] for piece in pieces] == list(expected.labels)
        uncertainty = [piece["uncertainty"] for piece in pieces]
        np.testing.assert_allclose(uncertainty, expected.distances, atol=1e-6)
    assert found["fitness"] == pytest.approx(actions.fitness.tolist(), abs=1e-6)
    assert len(lines) == len(found["changes"]) + len(found["forecasts"]) + 1
    assert any("  next     block right" in line for line in lines)
    # What the run found in this recording is foreseen again: most blocks that follow do.
    starts = {round(piece["start_s"], 6): k for k, piece in enumerate(found["blocks"]["right"])}
    labels = [piece["label"] for piece in found["blocks"]["right"]]
    last = {round(told["start_s"], 6): told["label"] for told in found["forecasts"]}
    told = [(label, labels[starts[at]]) for at, label in last.items() if at in starts]
    assert len(told) > 5
    assert np.mean([label == truth for label, truth in told if truth != "idle"]) > 0.7
    # Whether this person rests is told by this recording alone: others count as half a sighting.
    assert np.mean([label == truth for label, truth in told]) > 0.6
    assert any(" final    block right" in line and "throw (" in line for line in lines)
    assert any(" final    action 1" in line and "toss (" in line for line in lines)


def test_a_model_is_followed(monkeypatch, tmp_path, capsys, model, start_of_sample):
    code = call(
        monkeypatch, "follow", start_of_sample, "--model", model, "--calibration", 4,
        "--json", tmp_path / "f.json",
    )  # fmt: skip
    out = capsys.readouterr().out
    assert code == 0
    assert "throw (" in out
    assert "blocks (right); a block is known" in out
    found = json.loads((tmp_path / "f.json").read_text())
    pieces = found["blocks"]["right"]
    assert {"strike_out", "throw", "swing_out"} <= {piece["label"] for piece in pieces}
    assert all(piece["final"] for piece in pieces)
    assert min(change["time_s"] for change in found["changes"]) == pytest.approx(4.0, abs=0.3)
    assert found["actions"] == []
    assert found["seconds_per_sample"]["median"] < 0.05


def test_speed_is_kept(model, start_of_sample):
    replay = Replay(start_of_sample, make_plan(None, [model]), speed=30.0)
    for _ in replay.run():
        pass
    assert sum(replay.seconds) < 0.3


def test_bad_input(tmp_path, model, start_of_sample):
    with pytest.raises(ConfigError, match="got neither --run nor --model; expected a run folder"):
        make_plan(None, [])
    with pytest.raises(RunError, match=r"not a run: pipeline\.yaml is missing"):
        make_plan(tmp_path, [])
    with pytest.raises(BesmanError, match="cannot be read"):
        make_plan(None, [tmp_path / "nothing"])
    with pytest.raises(ConfigError, match="--calibration: got -1 s; expected a positive time"):
        make_plan(None, [model], calibration_s=-1.0)
    plan = make_plan(None, [model])
    with pytest.raises(ConfigError, match="--speed: got 0; expected a positive factor"):
        Replay(start_of_sample, plan, speed=0.0)
    with pytest.raises(BesmanError, match="got arms right, right; expected one or more"):
        Replay(start_of_sample, make_plan(None, [model, model]))
    with pytest.raises(LabellingError, match="marker 'left_shoulder' of two_arms is not there"):
        Replay(start_of_sample, make_plan(None, [model], "two_arms"))
