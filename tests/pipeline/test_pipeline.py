"""The whole pipeline on a small synthetic capture, in process."""

import hashlib
import json
import re
import shutil

import numpy as np
import pytest
import yaml
from command_line import SMALL_RUN, besman
from places import TOP

from besman.io.exports import read_joint_csv
from besman.io.segments_json import read_throws
from besman.pipeline.pipeline import STAGES
from besman.records.files import load_record
from besman.robot.limits import check_limits, resample_trajectory
from besman.robot.model import load_robot
from besman.synthetic.datasets import write_synthetic

STICK_THROW = TOP / "pipelines" / "ur5_stick_throw.yaml"


def tree(folder):
    """Digest of every file below a folder."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


FAST = tuple(word for setting in SMALL_RUN for word in ("--set", setting))


@pytest.fixture(scope="module")
def capture(small_capture):
    return small_capture


@pytest.fixture(scope="module")
def finished(small_run, tmp_path_factory):
    """A finished run that may be changed."""
    folder = tmp_path_factory.mktemp("finished") / "run"
    return shutil.copytree(small_run, folder, ignore=shutil.ignore_patterns(".lock"))


@pytest.fixture(scope="module")
def stranger(tmp_path_factory):
    """Recording of another person who throws once (synthetic), without segments."""
    folder = tmp_path_factory.mktemp("stranger")
    write_synthetic("stick_throw", folder, n_subjects=1, n_repetitions=1, seed=4)
    for file in folder.glob("*.json"):
        file.unlink()
    (recording,) = folder.glob("*.tsv")
    return recording


def test_every_stage_that_runs_can_be_computed_anew():
    files = [TOP / "besman/pipeline" / name for name in ("pipeline.py", "learning.py")]
    text = "".join(path.read_text() for path in files)
    said = re.findall(r'run\.(?:step|prepare)\(\s*f?"([a-z_]+)(\{arm\})?"', text)
    names = {name + arm for name, second in said for arm in (("", "_second") if second else ("",))}
    assert len(said) > 15
    assert sorted(names) == sorted(STAGES)


def results(folder):
    return json.loads((folder / "results.json").read_text())


def test_every_stage_did_its_work(finished):
    found = results(finished)
    assert found["label"]["n_recordings"] == 1
    assert found["segment"]["f1"] > 0.9
    assert found["recognize"]["counts"]["throw"] == 3
    assert found["map"]["n_transferred"] == 3
    assert found["map"]["limit_violations"] == found["map"]["self_collisions"] == 0
    assert found["map"]["position_error_m"]["max"] < 0.01
    assert found["refine"]["n_success"] == 3
    assert found["refine"]["miss_m"]["max"] < 0.05


def test_every_figure_is_in_the_documentation(finished):
    page = TOP / "docs/reference/results.md"
    known = set(re.findall(r"`(\w+)`", page.read_text()))
    for stage, figures in results(finished).items():
        assert stage in known
        names = {name.removesuffix("_manual") for name in figures}
        assert names <= known, stage
    robustness = results(finished)["refine"]["robustness"]
    assert set(robustness) | set(robustness["miss_m"]) <= known


def test_the_files_of_the_design_are_there(finished):
    assert {
        "run.json",
        "pipeline.yaml",
        "timing.json",
        "results.json",
        "report.html",
        "log.txt",
    } <= {path.name for path in finished.iterdir()}
    state = json.loads((finished / "run.json").read_text())
    assert state["status"] == "done"
    assert set(state["inputs"]) >= {
        "subject1.tsv",
        "subject1_manually_segmented.json",
        "person.tsv",
    }
    names = [row["name"] for row in json.loads((finished / "timing.json").read_text())["stages"]]
    assert names == [
        "read", "label", "segment", "train", "recognize", "select", "map", "imitate", "refine",
        "robustness",
    ]  # fmt: skip


def test_exports_hold_every_limit_at_1_khz(finished):
    robot = load_robot("ur5", "stick_holder")
    files = sorted((finished / "exports").glob("*[0-9].csv"))
    assert len(files) == 3
    for file in files:
        time, positions, velocities, accelerations = read_joint_csv(file)
        np.testing.assert_allclose(np.diff(time), 0.001, atol=1e-9)
        report = check_limits(robot, positions, velocities, accelerations)
        assert report.violations == 0
        assert report.self_collisions == 0
        # The velocities are those of the positions, not a column beside them.
        np.testing.assert_allclose(
            np.gradient(positions, time, axis=0)[1:-1], velocities[1:-1], atol=0.05
        )
        message = json.loads(file.with_suffix(".ros.json").read_text())
        assert len(message["points"]) == len(time)


def test_targets_are_where_the_stick_came_down(finished, capture):
    throws = read_throws(next(capture.glob("*.json")))
    touchdowns = np.array([throw.touchdown_m for throw in throws])
    demonstrations = load_record(finished / "05_select" / "record.npz")
    assert len(demonstrations) == len(touchdowns) == 3
    # Distances between touchdowns do not depend on the frame they are given in.
    found = np.array([demonstration.target for demonstration in demonstrations])
    for first in range(3):
        for second in range(first):
            expected = np.linalg.norm(touchdowns[first] - touchdowns[second])
            assert np.linalg.norm(found[first] - found[second]) == pytest.approx(expected, abs=0.02)


def test_a_warm_run_does_no_work(finished, capture, monkeypatch):
    before = tree(finished)
    code = besman(
        monkeypatch, "run", STICK_THROW, "--out", finished, "--set", f"recordings={capture}", *FAST
    )
    assert code == 0
    timing = json.loads((finished / "timing.json").read_text())
    assert all(row["cached"] for row in timing["stages"] if row["name"] != "read")
    after = tree(finished)
    for name, checksum in before.items():
        if name.endswith((".npz", ".csv", "results.json")):
            assert after[name] == checksum, name


def test_threads_do_not_change_the_result(finished, capture, tmp_path, monkeypatch, undrawn):
    run = shutil.copytree(finished, tmp_path / "r", ignore=shutil.ignore_patterns(".lock"))
    # What is before works on one recording, in one thread. The threads of mapping and refinement
    # are shown by stages/map/test_map_demonstrations.py and stages/refine/test_stage.py.
    again = ["imitate", "robustness"]
    for name in again:
        (place,) = run.glob(f"[0-9][0-9]_{name}")
        shutil.rmtree(place)
    code = besman(
        monkeypatch, "run", STICK_THROW, "--out", run, "--jobs", 1,
        "--set", f"recordings={capture}", *FAST,
    )  # fmt: skip
    assert code == 0
    timing = json.loads((run / "timing.json").read_text())["stages"]
    computed = [row["name"] for row in timing if not row["cached"]]
    assert computed == ["read", *again]
    for name in again:
        (expected,) = finished.glob(f"[0-9][0-9]_{name}/record.npz")
        (found,) = run.glob(f"[0-9][0-9]_{name}/record.npz")
        assert found.read_bytes() == expected.read_bytes()


def with_episodes(finished, folder, n):
    """Copy a run; its recipe allows that many episodes."""
    run = shutil.copytree(finished, folder, ignore=shutil.ignore_patterns(".lock"))
    recipe = (run / "pipeline.yaml").read_text()
    assert "episodes: 100\n" in recipe
    (run / "pipeline.yaml").write_text(recipe.replace("episodes: 100\n", f"episodes: {n}\n"))
    return run


def test_retarget_uses_the_trained_model(finished, stranger, tmp_path, monkeypatch, undrawn):
    run = with_episodes(finished, tmp_path / "run", 400)
    assert besman(monkeypatch, "retarget", run, stranger, "--out", tmp_path / "out") == 0
    found = results(tmp_path / "out")
    assert found["recognize"]["counts"]["throw"] == 1
    assert "accuracy" not in found["recognize"]
    assert found["refine"]["n_success"] == 1
    assert not list((tmp_path / "out").glob("*train*"))


@pytest.mark.slow
def test_retarget_goes_on_if_one_of_several_robots_fails(
    finished, stranger, tmp_path, monkeypatch, capsys, undrawn
):
    options = [word for name in ("ur10", "ur11", "iiwa7") for word in ("--robot", name)]
    out = tmp_path / "all"
    run = with_episodes(finished, tmp_path / "run", 2)
    assert besman(monkeypatch, "retarget", run, stranger, *options, "--out", out) == 2
    said = capsys.readouterr()
    assert re.search(r"ur10 +1 of 1 .*\n.*ur11 +failed.*\n.*iiwa7 +1 of 1 ", said.out)
    error = said.err.strip().splitlines()[-1]
    message = "besman: error: retarget: 1 of 3 robots failed: ur11: no robot 'ur11'; did you mean"
    assert error.startswith(message)
    for name in ("ur10", "iiwa7"):
        assert json.loads((out / name / "run.json").read_text())["status"] == "done"
        assert (out / name / "report.html").is_file()
    assert not (out / "ur11").exists()


def test_retarget_refuses_a_robot_twice(finished, capture, monkeypatch, capsys):
    twice = ("--robot", "ur10", "--robot", "ur10")
    assert besman(monkeypatch, "retarget", finished, capture, *twice) == 2
    assert "--robot: got 'ur10' twice; expected each robot once" in capsys.readouterr().err


def test_what_fails_is_a_row_in_every_stage(
    finished, capture, tmp_path, monkeypatch, capsys, undrawn
):
    """A stage loses one demonstration; the next ones go on with the rest, also from the cache."""
    from besman.exceptions import MappingError
    from besman.stages.imitate.stage import ImitateConfig
    from besman.stages.select import stage

    names = [one.name for one in load_record(finished / "05_select" / "record.npz")]
    select, imitate = stage.map_record, ImitateConfig._imitate

    def lose_first(*arguments, name, **options):
        if name == names[0]:
            raise MappingError(f"{name}: marker 'hand_top' is not seen in <frame> 7")
        return select(*arguments, name=name, **options)

    def lose_second(self, trajectory, robot):
        if trajectory.name == names[1]:
            raise ZeroDivisionError("nothing moves")
        return imitate(self, trajectory, robot)

    monkeypatch.setattr(stage, "map_record", lose_first)
    monkeypatch.setattr(ImitateConfig, "_imitate", lose_second)
    arguments = ("run", STICK_THROW, "--out", tmp_path / "r", "--set", f"recordings={capture}")
    few = ("--set", "refine.episodes=2", "--set", "refine.robustness=null")
    for _ in range(2):
        assert besman(monkeypatch, *arguments, *FAST, *few) == 0
        found = results(tmp_path / "r")
        reason = "marker 'hand_top' is not seen in <frame> 7"
        assert found["select"] == {
            "n_demonstrations": 2,
            "failed": [{"name": names[0], "reason": reason}],
            "target": dict.fromkeys(names[1:], "object"),
        }
        assert found["map"]["n_demonstrations"] == 2
        lost = {"name": names[1], "reason": "ZeroDivisionError: nothing moves"}
        assert found["imitate"]["failed"] == [lost]
        assert found["refine"]["n_motions"] == 1
        assert found["refine"]["failed"] == []
        said = capsys.readouterr().out
        assert f"select: 1 left out\n  {names[0]}: {reason}\n" in said
        page = (tmp_path / "r" / "report.html").read_text()
        assert "marker &#x27;hand_top&#x27; is not seen in &lt;frame&gt; 7" in page
        assert "ZeroDivisionError: nothing moves" in page


def test_report_is_one_file_without_network(finished, monkeypatch):
    (finished / "report.html").unlink()
    assert besman(monkeypatch, "report", finished) == 0
    page = (finished / "report.html").read_text()
    assert "<svg" in page
    assert "http://" not in page.replace("http://www.w3.org", "").replace(
        "http://purl.org", ""
    ).replace("http://creativecommons.org", "")
    assert page.count("<script") == 1
    assert "table 7.1" in page


def test_check_names_what_it_found(monkeypatch, capsys):
    assert besman(monkeypatch, "check", "ur5_stick_throw") == 0
    said = capsys.readouterr().out
    assert "recordings: 2" in said
    assert "throw 16" in said
    assert "stick_holder" in said


def copy_pipeline(folder, **changes):
    """Write a changed copy of the pipeline; return its path."""
    content = yaml.safe_load(STICK_THROW.read_text())
    content["recordings"] = str(TOP / "data" / "stick_throw")
    for key, value in changes.items():
        content[key] = value
    path = folder / "p.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path


def line_of(path, word):
    lines = path.read_text().splitlines()
    return next(number for number, line in enumerate(lines, 1) if line.strip().startswith(word))


def misspelt_key(folder, capture):
    path = copy_pipeline(folder, segment={"method": "vmci", "rat_hz": 30})
    line = line_of(path, "rat_hz")
    return path, (), rf"p\.yaml:{line}: unknown key 'segment\.rat_hz'; did you mean 'rate_hz'\?"


def duplicate_key(folder, capture):
    path = copy_pipeline(folder)
    path.write_text(path.read_text() + "robot: ur10\n")
    return path, (), r"key 'robot' is there twice, first in line \d+"


def missing_pipeline(folder, capture):
    return folder / "nothing.yaml", (), r"no file and no resource named"


def missing_recording(folder, capture):
    return STICK_THROW, ("--set", "recordings=nothing.tsv"), r"nothing\.tsv: no such file"


def empty_tsv(folder, capture):
    (folder / "a.tsv").write_text("")
    return STICK_THROW, ("--set", f"recordings={folder / 'a.tsv'}"), r"a\.tsv.*empty"


def truncated_tsv(folder, capture):
    text = next(capture.glob("*.tsv")).read_text()
    (folder / "a.tsv").write_text(text[: len(text) // 2])
    return STICK_THROW, ("--set", f"recordings={folder / 'a.tsv'}"), r"a\.tsv:\d+: .*expected"


def missing_marker(folder, capture):
    text = next(capture.glob("*.tsv")).read_text().replace("Elbow", "Nose")
    (folder / "a.tsv").write_text(text)
    segments = next(capture.glob("*_manually_segmented.json")).read_text()
    (folder / "a_manually_segmented.json").write_text(segments)
    settings = ("--set", f"recordings={folder / 'a.tsv'}", "--set", "label={markers: right_arm}")
    return STICK_THROW, settings, r"a\.tsv: .*'?elbow'?"


def no_examples(folder, capture):
    file = next(capture.glob("*.tsv"))
    (folder / "a.tsv").write_text(file.read_text())
    return STICK_THROW, ("--set", f"recordings={folder / 'a.tsv'}"), r"no labelled examples"


def class_without_examples(folder, capture):
    settings = ("--set", f"recordings={capture}", "--set", "recognize.classes=[throw, thro]")
    return STICK_THROW, settings, r"'?thro'?.*"


def unreachable(folder, capture):
    settings = ("--set", f"recordings={capture}", "--set", "map.greatest_error_m=1e-9", *FAST)
    # Wherever the demonstrations are placed.
    settings += ("--set", "map.correct=false", "--set", "map.evaluations=5")
    return STICK_THROW, settings, r"subject1\.tsv:\d+.*expected|m from|greatest_error_m"


def limit_of_zero(folder, capture):
    robot = (TOP / "robots" / "ur5" / "robot.yaml").read_text().replace("name: ur5", "name: own")
    text = robot.replace("velocity_deg_s: 180", "velocity_deg_s: 0", 1)
    assert text != robot
    (folder / "robot.yaml").write_text(text)
    settings = ("--set", f"recordings={capture}", "--set", f"robot={folder / 'robot.yaml'}", *FAST)
    return STICK_THROW, settings, r"velocity.*got 0"


def unknown_robot(folder, capture):
    return STICK_THROW, ("--set", "robot=ur6"), r"no robot 'ur6'; did you mean 'ur5'\?"


def missing_model(folder, capture):
    settings = ("--set", f"recognize.model={folder / 'nomodel'}")
    return STICK_THROW, settings, r"nomodel\.json: cannot be read: No such file or directory"


def unknown_stage(folder, capture):
    return STICK_THROW, ("--fresh", "segmnt"), r"no stage 'segmnt'; did you mean 'segment'\?"


def bad_setting(folder, capture):
    return STICK_THROW, ("--set", "segment"), r"--set: got 'segment', expected KEY=VALUE"


def setting_below_a_value(folder, capture):
    return STICK_THROW, ("--set", "robot.name=x"), r"'robot' is a value and has no keys below it"


def setting_not_yaml(folder, capture):
    return STICK_THROW, ("--set", "robot=[x"), r"not a YAML value"


BAD = [
    misspelt_key, duplicate_key, missing_pipeline, missing_recording, empty_tsv, truncated_tsv,
    missing_marker, no_examples, class_without_examples, unreachable, limit_of_zero,
    unknown_robot, missing_model, unknown_stage, bad_setting, setting_below_a_value,
    setting_not_yaml,
]  # fmt: skip


@pytest.mark.parametrize(
    "settings",
    ["robot=ur6", "tool=scoop", "recognize.model=none", "select.label=thro"],
    ids=lambda one: one,
)
def test_a_slip_costs_no_finished_run(finished, tmp_path, monkeypatch, capsys, settings):
    run = tmp_path / "run"
    shutil.copytree(finished, run)
    before = tree(run)
    assert besman(monkeypatch, "run", STICK_THROW, "--out", run, "--set", settings) == 2
    assert tree(run) == before
    assert capsys.readouterr().err.count("besman: error: ") == 1


@pytest.mark.parametrize("make", BAD)
def test_bad_input_is_one_line_and_exit_code_2(make, tmp_path, capture, monkeypatch, capsys):
    (tmp_path / "in").mkdir()
    pipeline, settings, message = make(tmp_path / "in", capture)
    before = tree(tmp_path / "in"), tree(capture)
    code = besman(monkeypatch, "run", pipeline, "--out", tmp_path / "out", *settings)
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert code == 2
    assert re.search(message, said), said
    assert said.startswith("besman: error: ")
    assert "Traceback" not in said
    assert (tree(tmp_path / "in"), tree(capture)) == before


def test_a_failed_run_leaves_a_good_one_as_it_was(finished, tmp_path, monkeypatch):
    shutil.copytree(finished, tmp_path / "r", ignore=shutil.ignore_patterns(".lock"))
    before = {name: sha for name, sha in tree(tmp_path / "r").items() if name.endswith(".npz")}
    code = besman(
        monkeypatch, "run", STICK_THROW, "--out", tmp_path / "r", "--set", "recordings=nothing"
    )
    assert code == 2
    after = {name: sha for name, sha in tree(tmp_path / "r").items() if name.endswith(".npz")}
    assert after == before


def test_retarget_and_report_of_something_else(tmp_path, monkeypatch, capsys):
    assert besman(monkeypatch, "report", tmp_path) == 2
    assert "not a run: run.json is missing" in capsys.readouterr().err
    assert besman(monkeypatch, "retarget", tmp_path, tmp_path) == 2
    assert "not a run: pipeline.yaml is missing" in capsys.readouterr().err


def test_resampling_an_export_changes_nothing(finished):
    time, *rest = read_joint_csv(next((finished / "exports").glob("*[0-9].csv")))
    _, positions, *_ = resample_trajectory(time, *rest, rate_hz=1000.0)
    np.testing.assert_allclose(positions[:-1], rest[0][: len(positions) - 1], atol=1e-5)
