"""`besman runs`, `besman clean`, and `besman check` of a run folder."""

import shutil

import pytest
from command_line import besman
from small_runs import run_exports, run_two_stages, short_motions

from besman.pipeline.run_folder import Run
from besman.pipeline.sealed_page import fault_of_page
from besman.pipeline.stored_run import open_run
from besman.report.page import write_page
from besman.report.runs_table import size


@pytest.fixture
def finished(tmp_path, robot, make_plan):
    """A run that is done, of two quick stages with exports."""
    motions = short_motions(make_plan, ("a.tsv:1",))
    folder = tmp_path / "runs" / "done"
    folder.parent.mkdir()
    run_exports(folder, motions, robot, more=("one",))
    return folder


def said(monkeypatch, capsys, *arguments):
    code = besman(monkeypatch, *arguments)
    told = capsys.readouterr()
    assert "Traceback" not in told.err
    return code, told.out, told.err


def test_runs_lists_status_recipe_and_size(finished, monkeypatch, capsys):
    place = finished.parent
    failed = Run(place / "failed", "test")
    failed.start("name: test\nrobot: ur5\ntask: reach\n", {})
    failed.finish("failed", "no [red]markers")
    killed = Run(place / "killed", "test")
    killed.start("name: test\n", {})
    killed._lock.close()
    shutil.copytree(finished, place / "damaged")
    (place / "damaged" / "run.json").write_text("[]")
    shutil.copytree(finished, place / "all" / "ur10")
    going = Run(place / "going", "test")
    going.start("name: test\n", {})
    (place / "no run").mkdir()
    monkeypatch.setenv("COLUMNS", "200")
    code, out, _ = said(monkeypatch, capsys, "runs", place)
    rows = {
        line.split()[0]: " ".join(line.split()[1:]) for line in out.splitlines() if line.strip()
    }
    going.finish()
    assert code == 0
    assert rows["done"].startswith("done test, ur5, reach ")
    assert rows["all/ur10"].startswith("done test, ur5, reach ")
    assert rows["failed"].startswith("failed: no [red]markers test, ur5, reach ")
    assert rows["killed"].startswith("killed test ")
    assert rows["going"].startswith("running test ")
    assert rows["damaged"].startswith("damaged: ")
    assert "run.json: expected an object, got a list" in rows["damaged"]
    assert rows["done"].endswith("kB")
    assert "no" not in rows


def test_runs_of_nothing(tmp_path, monkeypatch, capsys):
    assert said(monkeypatch, capsys, "runs", tmp_path)[1].endswith(": no runs here\n")
    code, _, err = said(monkeypatch, capsys, "runs", tmp_path / "no")
    assert code == 2
    assert "there is no such folder; expected a folder of runs" in err


def test_sizes_are_for_people():
    assert [size(n) for n in (812, 3400, 16_200_000, 1_240_000_000)] == [
        "812 B",
        "3.4 kB",
        "16 MB",
        "1.2 GB",
    ]


def test_clean_says_first_and_removes_on_yes(finished, tmp_path, monkeypatch, capsys):
    assert said(monkeypatch, capsys, "clean", finished)[1].endswith(": nothing to remove\n")
    run_two_stages(tmp_path / "other", names=("label", "train"))
    shutil.copytree(tmp_path / "other" / "01_train", finished / "08_train")
    (finished / ".05_refine.going").mkdir()
    (finished / ".05_refine.going" / "kept").write_bytes(bytes(1000))
    (finished / ".results.tmp12_3.json").write_text("half")
    (finished / "exports" / "old_1.script").write_text("def old():")
    before = {path.name for path in finished.rglob("*")}
    code, out, _ = said(monkeypatch, capsys, "clean", finished)
    assert code == 0
    assert ".05_refine.going: 1.0 kB, is no part of this run" in out
    assert "08_train: " in out
    assert "exports/old_1.script: 10 B, is no part of this run" in out
    assert ".results.tmp12_3.json: 4 B, was left half written" in out
    assert f"in all; besman clean {finished} --yes removes it" in out.replace("\n", "")
    assert {path.name for path in finished.rglob("*")} == before
    assert "removed: " in said(monkeypatch, capsys, "clean", finished, "--yes")[1]
    gone = {"08_train", ".05_refine.going", ".results.tmp12_3.json", "old_1.script", "kept"}
    assert before - {path.name for path in finished.rglob("*")} == gone
    assert open_run(finished).record("refine")


def test_clean_leaves_alone_what_a_run_may_go_on_with(finished, monkeypatch, capsys):
    run = Run(finished, "test")
    run.start("name: other\n", {})
    code, _, err = said(monkeypatch, capsys, "clean", finished, "--yes")
    assert code == 2
    assert "the run is not done (status 'running') and may go on with what lies here" in err
    run.finish("failed", "x")
    assert said(monkeypatch, capsys, "clean", finished, "--yes")[0] == 2
    assert (finished / "00_one").is_dir()


def test_check_verifies_a_folder(finished, monkeypatch, capsys):
    code, out, _ = said(monkeypatch, capsys, "check", finished)
    assert code == 1
    assert "not whole: report.html is missing; besman report writes it" in out
    page = write_page(finished)
    code, out, _ = said(monkeypatch, capsys, "check", finished)
    assert code == 0
    assert out.splitlines() == [
        "stages: 2: whole",
        "figures, truth, recipe: whole",
        "exports: 8 files: whole",
        "report: whole",
        "nothing of another recipe",
    ]
    page.write_bytes(page.read_bytes()[:-200])
    (finished / "01_refine" / "record.npz").write_bytes(b"cut")
    (finished / "results.json").unlink()
    (finished / "exports" / "a_1.csv").write_text("cut")
    code, out, _ = said(monkeypatch, capsys, "check", finished)
    assert code == 1
    assert out.splitlines() == [
        "nothing of another recipe",
        "not whole: 01_refine: record.npz is cut or changed",
        "not whole: results.json is missing",
        "not whole: exports/a_1.csv is cut or changed",
        "not whole: report.html is cut or changed; besman report writes it anew",
        "the command that made the run repairs it",
    ]


def test_check_of_a_run_that_is_not_done(finished, monkeypatch, capsys):
    run = Run(finished, "test")
    run.start("name: test\n", {})
    code, _, err = said(monkeypatch, capsys, "check", finished)
    assert code == 2
    assert "another besman is working here; wait until it has ended" in err
    run.finish("failed", "no markers")
    code, out, _ = said(monkeypatch, capsys, "check", finished)
    assert code == 1
    assert "not whole: status: failed: no markers" in out
    code, _, err = said(monkeypatch, capsys, "check", finished, "--set", "robot=ur10")
    assert code == 2
    assert "is a run folder, which takes no settings" in err


def test_a_report_knows_of_what_it_was_made(finished, robot, make_plan):
    page = write_page(finished)
    assert fault_of_page(page, open_run(finished).fingerprint()) is None
    content = page.read_bytes()
    run_exports(finished, short_motions(make_plan, ("b.tsv:1",)), robot, more=("one",))
    assert not page.exists()
    page.write_bytes(content)
    assert fault_of_page(page, open_run(finished).fingerprint()) == "shows what the run was before"
