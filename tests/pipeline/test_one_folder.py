"""One folder, many recipes: it holds what the last one made, whole and alone."""

import json
import os
import shutil
from dataclasses import replace

import pytest
from small_runs import CALLS, START, Cut, run_exports, run_two_stages, short_motions, state_of

from besman.exceptions import RunError
from besman.pipeline.check_run import check_run
from besman.pipeline.derived_files import note_file, stale_files
from besman.pipeline.finished_run import trained_model
from besman.pipeline.run_folder import Run
from besman.pipeline.stored_run import open_run
from besman.report.run_records import load_records

ENDINGS = ("csv", "ros.json", "ros.yaml", "script")
ENDINGS += tuple(f"approach.{one}" for one in ENDINGS[:-1])


@pytest.fixture(autouse=True)
def _no_calls():
    CALLS.clear()


@pytest.fixture(scope="module")
def motions(make_plan):
    return short_motions(make_plan, ("a.tsv:1", "a.tsv:2", "b.tsv:1"))


def exports_of(*names):
    return {"limits.json", *(f"{name}.{ending}" for name in names for ending in ENDINGS)}


def names_in(folder):
    return {path.name for path in folder.iterdir()}


def log_of(folder):
    return (folder / "log.txt").read_text()


def test_exports_are_those_of_the_last_recipe(tmp_path, robot, motions):
    run_exports(tmp_path / "r", motions, robot)
    assert names_in(tmp_path / "r/exports") == exports_of("a_1", "a_2", "b_1")
    run_exports(tmp_path / "r", motions[1:2], robot)
    assert names_in(tmp_path / "r/exports") == exports_of("a_2")
    limits = json.loads((tmp_path / "r/exports/limits.json").read_text())
    assert limits.keys() == {"robot", "tool", "rate_hz", "motions"}
    assert limits["motions"].keys() == {"a_2"}
    assert check_run(tmp_path / "r")[1] == ["report.html is missing; besman report writes it"]


@pytest.mark.parametrize("days", [-1, 0, 1])
def test_exports_are_current_by_content_not_by_the_clock(tmp_path, robot, motions, make_plan, days):
    run_exports(tmp_path / "r", motions, robot)
    before = (tmp_path / "r/exports/a_1.csv").read_bytes()
    at = round((tmp_path / "r").stat().st_mtime) + 86400 * days
    for path in (tmp_path / "r").rglob("*"):
        os.utime(path, (at, at))
    run_exports(tmp_path / "r", motions, robot)
    assert (tmp_path / "r/exports/a_1.csv").stat().st_mtime == at
    slower = short_motions(make_plan, ("a.tsv:1",), duration=0.2)
    run_exports(tmp_path / "r", slower, robot)
    assert (tmp_path / "r/exports/a_1.csv").read_bytes() != before


@pytest.mark.parametrize("fault", ["is missing", "is cut or changed", "is no part of this run"])
def test_what_is_wrong_with_an_export_is_told_and_mended(tmp_path, robot, motions, fault):
    folder = tmp_path / "r"
    run_exports(folder, motions[:1], robot)
    path = folder / "exports" / "a_1.csv"
    whole = path.read_bytes()
    if fault == "is missing":
        path.unlink()
    elif fault == "is cut or changed":
        path.write_bytes(whole[:50])
    else:
        path = path.with_name("old_7.script")
        path.write_text("def besman_old_7():")
    assert f"exports/{path.name} {fault}" in check_run(folder)[1]
    run_exports(folder, motions[:1], robot)
    assert names_in(folder / "exports") == exports_of("a_1")
    assert (folder / "exports/a_1.csv").read_bytes() == whole
    assert f"exports/{path.name} {fault}: written again" in log_of(folder)


def test_what_a_user_put_beside_the_exports_stays(tmp_path, robot, motions):
    run_exports(tmp_path / "r", motions, robot)
    (tmp_path / "r/exports/notes.txt").write_text("slow down")
    run_exports(tmp_path / "r", motions[:1], robot)
    assert names_in(tmp_path / "r/exports") == exports_of("a_1") | {"notes.txt"}


def test_of_two_arms_the_second_s_exports_go_with_it(tmp_path, robot, motions):
    run_exports(tmp_path / "r", motions, robot, more=("x",), arms=("", "_second"))
    assert names_in(tmp_path / "r/exports_second") == exports_of("a_1", "a_2", "b_1")
    run_exports(tmp_path / "r", motions, robot)
    assert not (tmp_path / "r/exports_second").exists()


def test_a_run_that_fails_shows_nothing_of_another_recipe(tmp_path, robot, motions):
    folder = tmp_path / "r"
    run_exports(folder, motions, robot, more=("train",))
    (folder / "report.html").write_text("done")
    run = Run(folder, "test")
    run.start("name: other\n", {})
    run.finish("failed", "no markers")
    assert not (folder / "exports").exists()
    assert not (folder / "report.html").exists()
    assert json.loads((folder / "results.json").read_text()) == {}
    with pytest.raises(RunError, match="no trained model here"):
        trained_model(folder)
    # The stages are there still: the recipe before finds them.
    CALLS.clear()
    run_exports(folder, motions, robot, more=("train",))
    assert not CALLS
    assert names_in(folder / "exports") == exports_of("a_1", "a_2", "b_1")


def test_the_same_recipe_keeps_its_exports_also_when_it_is_stopped(tmp_path, robot, motions):
    folder = tmp_path / "r"
    run_exports(folder, motions, robot)
    text = (folder / "pipeline.yaml").read_text()
    before = (folder / "exports").stat().st_ino
    run = Run(folder, "test")
    run.start(text, {})
    run.finish("failed", "stopped by SIGTERM")
    assert names_in(folder / "exports") == exports_of("a_1", "a_2", "b_1")
    run_exports(folder, motions, robot)
    assert (folder / "exports").stat().st_ino == before


def test_readers_take_the_run_s_stages_and_leftovers_go(tmp_path):
    folder = tmp_path / "r"
    run_two_stages(folder, names=("label", "train"))
    other = tmp_path / "other"
    run_two_stages(other, first=4, names=("label", "train"))
    # Left by a recipe with more stages.
    shutil.copytree(other / "01_train", folder / "07_train")
    assert list(open_run(folder).stages) == ["label", "train"]
    assert trained_model(folder).bounds[0, 1] == load_records(folder)["train"].bounds[0, 1] == 2
    assert "07_train is no part of this run" in check_run(folder)[1]
    (folder / "08_notes").mkdir()
    run_two_stages(folder, names=("label", "train"))
    assert sorted(path.name for path in folder.glob("[0-9]*")) == [
        "00_label",
        "01_train",
        "08_notes",
    ]
    assert "07_train: removed: it is no part of this run" in log_of(folder)


def test_a_run_of_an_older_besman_has_the_stages_with_the_highest_numbers(tmp_path):
    folder = tmp_path / "r"
    run_two_stages(folder, names=("label", "train"))
    run_two_stages(tmp_path / "other", first=4, names=("label", "train"))
    shutil.copytree(tmp_path / "other" / "00_label", folder / "02_label")
    state = state_of(folder)
    for name in ("stages", "files", "exports", "recipe"):
        state.pop(name)
    (folder / "run.json").write_text(json.dumps(state))
    assert open_run(folder).stages["label"].name == "02_label"
    assert open_run(folder).record("label").bounds[0, 1] == 4
    assert "run.json: names no digests: an older besman wrote it" in check_run(folder)[1]
    (folder / "run.json").unlink()
    assert trained_model(folder).bounds[0, 1] == 2


def test_a_video_of_other_motions_is_known_as_such(tmp_path, robot, motions):
    folder = tmp_path / "r"
    run_exports(folder, motions, robot)
    for name in ("video.mp4", "video_own.mp4"):
        (folder / name).write_bytes(b"moving")
    note_file(folder, folder / "video.mp4")
    note_file(folder, tmp_path / "elsewhere.mp4")
    assert stale_files(open_run(folder)) == []
    run_exports(folder, motions[:2], robot)
    assert stale_files(open_run(folder)) == ["video.mp4"]
    assert "video.mp4 shows other motions than the run holds" in check_run(folder)[1]
    (folder / "shown.json").write_text("[]")
    assert stale_files(open_run(folder)) == []


def test_a_folder_may_be_moved_and_copied(tmp_path, robot, motions):
    run_exports(tmp_path / "r", motions, robot)
    (tmp_path / "r").rename(tmp_path / "moved")
    shutil.copytree(tmp_path / "moved", tmp_path / "copy")
    CALLS.clear()
    for name in ("moved", "copy"):
        run_exports(tmp_path / name, motions, robot)
        assert check_run(tmp_path / name)[1] == ["report.html is missing; besman report writes it"]
    assert not CALLS


def test_two_motions_of_one_name_are_refused(tmp_path, robot, motions):
    twin = replace(motions[0], plan=replace(motions[0].plan, name="a.c3d:1"))
    with pytest.raises(RunError, match=r"a\.tsv:1 and a\.c3d:1 would both be written as a_1"):
        run_exports(tmp_path / "r", (motions[0], twin), robot)


def test_another_version_of_a_library_computes_again(tmp_path, monkeypatch):
    run_two_stages(tmp_path / "r")
    kept = json.loads((tmp_path / "r/01_two/stage.json").read_text())["versions"]
    assert {"python", "numpy", "scipy", "numba", "pin", "mujoco", "cma"} <= kept.keys()
    monkeypatch.setattr(
        "besman.pipeline.run_folder.result_versions", lambda others: {**kept, "numpy": "99.0"}
    )
    _, cached = run_two_stages(tmp_path / "r")
    assert cached == [False, False]
    stored = json.loads((tmp_path / "r/01_two/stage.json").read_text())
    assert stored["versions"]["numpy"] == "99.0"


def test_a_method_s_own_libraries_count(tmp_path):
    class Torched(Cut):
        libraries = ("torch",)

    run = Run(tmp_path / "r", "test")
    run.start("", {})
    run.step("one", Torched(), START)
    run.finish()
    stored = json.loads((tmp_path / "r/00_one/stage.json").read_text())
    assert "torch" in stored["versions"]
