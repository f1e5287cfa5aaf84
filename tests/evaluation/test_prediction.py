import json
import shutil

import numpy as np
import pytest
from places import REAL_DATA, SAMPLE

from besman.cli import main as cli
from besman.evaluation import prediction
from besman.evaluation.prediction import (
    evaluate_prediction,
    load_performances,
    prediction_note,
    prediction_tables,
)
from besman.exceptions import RecognitionError


@pytest.fixture(scope="module")
def result():
    return evaluate_prediction(SAMPLE)


def test_throws_are_foreseen_by_those_of_another(result):
    """Synthetic: three movements a throw, always in the same order, rests after the third."""
    assert {row["source"] for row in result["rows"]} == {"synthetic"}
    by = {
        (row["left_out"], row["blocks"], row["method"], row["seen_share"]): row
        for row in result["rows"]
    }
    for left_out in ("recording", "subject"):
        moved = (left_out, "movements")
        assert by[*moved, "order and movement", 0.0]["top1"] == 1
        assert by[*moved, "movement", 0.4]["top1"] > 0.9
        # Before it begins nothing is seen: three are as probable.
        assert by[*moved, "movement", 0.0]["log_loss"] == pytest.approx(np.log(3))
        assert by[*moved, "most frequent block", 0.0]["top1"] == pytest.approx(1 / 3)
        assert by[*moved, "most frequent next", 0.0]["top1"] == 1
        assert by[*moved, "same as last time", 0.0]["top1"] == 1
        assert by[*moved, "order and movement", 0.2]["start_error_s"] < 0.2
    n = {key[1]: row["n"] for key, row in by.items()}
    assert n["movements and rests"] > n["movements"] == 48
    assert result["figures"]["order_entropy"] < 0.05


def test_the_tables_say_what_they_are_about(result):
    titles = [table.title for table in prediction_tables(result)]
    assert titles[0] == "stick_throw (synthetic), new recording: 48 movements; top-1, log loss"
    assert len(titles) == 4
    assert "every movement is always followed by the same" in prediction_note(result)
    free = {"figures": {"seconds_per_sample": 1e-5, "order_entropy": 0.5}}
    assert prediction_note(free).endswith("0.50 nats")


def test_the_command_prints_and_writes_it(result, monkeypatch, tmp_path, capsys):
    asked = []
    monkeypatch.setattr(
        prediction, "evaluate_prediction", lambda *given: asked.append(given) or result
    )
    target = tmp_path / "p.json"
    arguments = ["evaluate", "prediction", "--data", str(SAMPLE), "--json", str(target)]
    monkeypatch.setattr("sys.argv", ["besman", *arguments])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert not stop.value.code
    assert asked[0][0] == SAMPLE
    assert "ms of CPU a sample" in capsys.readouterr().out
    assert json.loads(target.read_text())["experiment"] == "prediction"


def test_one_recording_alone_foresees_nothing(tmp_path):
    for path in SAMPLE.glob("subject1*"):
        shutil.copy(path, tmp_path)
    with pytest.raises(RecognitionError, match="got 1 recordings with segments; expected two"):
        load_performances(tmp_path)


def test_real_blocks_are_foreseen(tmp_path):
    """Of three recordings of each of two people; the table of all is in benchmarks/README.md."""
    folder = REAL_DATA / "pick_and_place"
    if not folder.is_dir():
        pytest.skip(f"no real recordings in {folder}; set BESMAN_REAL_DATA")
    for path in folder.glob("subject[12]_run[123]*"):
        shutil.copy(path, tmp_path)
    rows = {
        (row["left_out"], row["blocks"], row["method"], row["seen_share"]): row["top1"]
        for row in evaluate_prediction(tmp_path)["rows"]
    }
    assert rows["subject", "movements", "order and movement", 0.0] > 0.85
    assert rows["subject", "movements", "movement", 0.4] >= 0.97
    assert rows["recording", "movements and rests", "order and movement", 0.4] > 0.97
