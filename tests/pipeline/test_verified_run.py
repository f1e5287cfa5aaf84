from __future__ import annotations

import io
import json
import shutil

import numpy as np
import pytest
from command_line import besman
from rich.console import Console

from besman.exceptions import RunError, VerificationError
from besman.pipeline import verified_run
from besman.pipeline.derived_files import note_file
from besman.pipeline.finished_run import read_run
from besman.pipeline.stored_run import open_run
from besman.pipeline.verification_file import read_verification
from besman.pipeline.verified_run import (
    VerifiedMotion,
    verification_results,
    verify_run,
)
from besman.report.page import write_page
from besman.report.verification import verification_lines, verification_table
from besman.work.work import Work


@pytest.fixture
def run(small_run, tmp_path):
    return shutil.copytree(small_run, tmp_path / "run")


def shifted(motions, *shifts):
    """Say that motions land elsewhere in a second engine; None: not at all."""
    found = []
    for motion, shift in zip(motions, shifts, strict=True):
        known = shift is not None
        outcome = motion.outcome + np.array([shift if known else np.nan, 0, 0])
        miss = float(np.linalg.norm(outcome - motion.plan.target))
        said = "" if known else "stick not released"
        found.append(VerifiedMotion(motion, outcome, miss, known and miss <= 0.05, said))
    return tuple(found)


def test_figures_are_those_of_the_motions(run):
    finished = read_run(run)
    found = shifted(finished.motions, 0.0, 0.5, None)
    results = verification_results(found, finished.task, "drake", "1.51.1")
    assert results["mujoco"]["n_success"] == sum(one.success for one in finished.motions)
    assert results["drake"]["within"] == {"5 cm": 1, "10 cm": 1}
    assert results["apart_m"] == {"median": pytest.approx(0.25), "max": pytest.approx(0.5)}
    last = results["motions"][2]
    assert last["drake"]["outcome_m"][0] is None
    assert last["drake"]["failure"] == "stick not released"
    assert last["apart_m"] is None
    lines = verification_lines(results)
    assert lines[1].startswith("drake: 1 of 3 succeed, 1 within 5 cm, 1 within 10 cm, miss ")
    assert lines[2] == "25.0 cm apart (median), 50.0 cm (most)"
    console = Console(width=80, file=io.StringIO())
    console.print(verification_table(results))
    said = console.file.getvalue()
    assert "…" not in said
    x, y, _ = found[1].outcome
    assert f"{x:.2f} {y:.2f}" in said


def test_the_page_shows_what_was_verified_until_motions_change(run):
    finished = read_run(run)
    results = verification_results(
        shifted(finished.motions, 0.0, 0.5, None), finished.task, "drake", "1.51.1"
    )
    assert read_verification(open_run(run)) is None
    (run / "verify.json").write_text(json.dumps(results))
    note_file(run, run / "verify.json")
    page = write_page(run).read_text()
    assert "In a second engine: drake 1.51.1" in page
    assert "stick not released" in page
    shown = json.loads((run / "shown.json").read_text())
    shown["verify.json"]["of"] = "other motions"
    (run / "shown.json").write_text(json.dumps(shown))
    assert read_verification(open_run(run)) is None
    assert "In a second engine" not in write_page(run).read_text()


@pytest.mark.parametrize("content", ["{}", '{"engine": "drake", "drake": 1}', '{"engine": []}'])
def test_a_file_that_is_not_ours(run, content):
    (run / "verify.json").write_text(content)
    with pytest.raises(RunError, match=r"verify\.json: is not as besman writes it; besman verify"):
        read_verification(open_run(run))


def test_a_folder_that_is_no_run_and_an_engine_that_is_none(run, tmp_path):
    with pytest.raises(RunError, match=r"not a run: pipeline\.yaml is missing"):
        verify_run(tmp_path)
    with pytest.raises(VerificationError, match="--engine: got 'bullet'"):
        verify_run(run, "bullet")
    assert not (run / "verify.json").exists()


def test_a_motion_that_drake_cannot_simulate_fails_alone(run, monkeypatch):
    finished = read_run(run)

    def fail(robot, task, plan):
        raise VerificationError("drake cannot go on: singular")

    monkeypatch.setattr(verified_run, "try_in_second_engine", fail)
    monkeypatch.setattr(verified_run, "check_engine", lambda engine, task: None)
    monkeypatch.setattr(verified_run, "version", lambda engine: "1.51.1")
    found, results = verify_run(run, work=Work(1))
    assert [one.failure for one in found] == ["drake cannot go on: singular"] * 3
    assert json.loads((run / "verify.json").read_text()) == results
    assert results["drake"]["miss_m"] == {"median": None, "max": None}
    assert len(found) == len(finished.motions)


def test_the_command_writes_where_motions_end(run, monkeypatch, capsys):
    pytest.importorskip("pydrake", reason="the extra verify is not installed")
    assert besman(monkeypatch, "verify", run, "--jobs", 1) == 0
    said = capsys.readouterr().out
    assert "drake: " in said
    results = json.loads((run / "verify.json").read_text())
    assert results["n_motions"] == 3
    # What is compared with MuJoCo's own is near it.
    assert results["apart_m"]["median"] < 0.1
    assert "In a second engine: drake" in (run / "report.html").read_text()
