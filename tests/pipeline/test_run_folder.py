import json
import os
import signal
import subprocess
import sys
import textwrap

import pytest
from places import TESTS
from small_runs import CALLS, START, Cut, run_two_stages

from besman.config.stage import Items, Training, Truth, Work
from besman.exceptions import RunError
from besman.pipeline import run_folder
from besman.pipeline.run_folder import Run
from besman.pipeline.stage_store import spent_before
from besman.records import Failure
from besman.records.files import digest


@pytest.fixture(autouse=True)
def _no_calls():
    CALLS.clear()


def test_same_config_and_input_do_no_work(tmp_path):
    before, cached = run_two_stages(tmp_path / "r")
    assert cached == [False, False]
    CALLS.clear()
    after, cached = run_two_stages(tmp_path / "r")
    assert cached == [True, True]
    assert not CALLS
    assert digest(after) == digest(before)


def test_a_changed_parameter_re_runs_only_what_depends_on_it(tmp_path):
    run_two_stages(tmp_path / "r")
    _, cached = run_two_stages(tmp_path / "r", second=3)
    assert cached == [True, False]
    _, cached = run_two_stages(tmp_path / "r", first=4, second=3)
    assert cached == [False, False]


def test_fresh_computes_a_stage_again(tmp_path):
    run_two_stages(tmp_path / "r")
    _, cached = run_two_stages(tmp_path / "r", fresh="one")
    # The same bytes came out again, so nothing that follows has changed.
    assert cached == [False, True]


@pytest.mark.parametrize("damage", ["cut", "gone", "garbled json"])
def test_a_damaged_stage_is_computed_again(tmp_path, damage):
    before, _ = run_two_stages(tmp_path / "r")
    file = tmp_path / "r" / "00_one" / "record.npz"
    if damage == "cut":
        file.write_bytes(file.read_bytes()[:50])
    elif damage == "gone":
        file.unlink()
    else:
        (file.parent / "stage.json").write_text("{")
    after, cached = run_two_stages(tmp_path / "r")
    assert cached == [False, True]
    assert digest(after) == digest(before)


def test_the_files_of_a_run(tmp_path):
    run_two_stages(tmp_path / "r")
    state = json.loads((tmp_path / "r" / "run.json").read_text())
    timing = json.loads((tmp_path / "r" / "timing.json").read_text())
    assert state["status"] == "done"
    assert {"numpy", "besman", "python"} <= set(state["versions"])
    assert [row["name"] for row in timing["stages"]] == ["one", "two"]
    keys = {"name", "wall_s", "cpu_s", "human", "items", "unit", "cached", "peak_rss_mb"}
    assert keys <= set(timing["stages"][0])
    assert timing["total_wall_s"] > 0
    assert "name: test\n" in (tmp_path / "r" / "pipeline.yaml").read_text()
    assert not [path for path in (tmp_path / "r").iterdir() if ".tmp" in path.name]


KILLED = """
    import os, signal, sys
    sys.path.insert(0, {tests!r})
    import besman.pipeline.stage_store, small_runs
    from pathlib import Path

    if {when!r} == "while writing":
        def save(record, path):
            Path(path).write_bytes(b"half")
            os.kill(os.getpid(), signal.SIGKILL)
        besman.pipeline.stage_store.save_record = save
    else:
        def run(self, segments, *, work):
            os.kill(os.getpid(), signal.SIGKILL)
        small_runs.Cut.run = run
    small_runs.run_two_stages(Path({folder!r}), second=5)
"""


@pytest.mark.parametrize("when", ["while writing", "while computing"])
def test_kill_leaves_no_half_stage_and_the_same_command_goes_on(tmp_path, when):
    run_two_stages(tmp_path / "r")
    script = textwrap.dedent(KILLED).format(tests=str(TESTS), when=when, folder=str(tmp_path / "r"))
    killed = subprocess.run([sys.executable, "-c", script], check=False)
    assert killed.returncode == -signal.SIGKILL
    stored = json.loads((tmp_path / "r" / "01_two" / "stage.json").read_text())
    assert stored["config"]["at"] == 2
    after, cached = run_two_stages(tmp_path / "r", second=5)
    assert cached == [True, False]
    fresh, _ = run_two_stages(tmp_path / "other", second=5)
    assert digest(after) == digest(fresh)


def test_what_a_stopped_computation_took_adds_up(tmp_path):
    """Until it kept something last, be it stopped once or twice; a damaged note begins anew."""
    assert spent_before(tmp_path, 1000.0) == 0.0
    (tmp_path / "search").mkdir()

    def keep(name, at):
        (tmp_path / "search" / name).touch()
        os.utime(tmp_path / "search" / name, (at, at))

    keep("0", 1012.0)
    keep("1", 1030.0)
    assert spent_before(tmp_path, 2000.0) == pytest.approx(30.0)
    assert spent_before(tmp_path, 3000.0) == pytest.approx(30.0)  # nothing was kept in between
    keep("2", 3005.0)
    assert spent_before(tmp_path, 4000.0) == pytest.approx(35.0)
    (tmp_path / "spent.json").write_text('{"spent_s": 1')
    assert spent_before(tmp_path, 5000.0) == 0.0


def test_the_time_of_a_stage_is_that_of_all_its_parts(tmp_path, monkeypatch):
    class Kept(Cut):
        keeps_checkpoints = True

    monkeypatch.setattr(run_folder, "spent_before", lambda *_: 100.0)
    run = Run(tmp_path / "r", "test")
    run.start("", {})
    run.step("two", Kept(), run.step("one", Cut(), START))
    run.finish()
    one, two = run.timing
    assert one["computed_wall_s"] < 50
    assert 100 <= two["computed_wall_s"] < 150
    assert two["wall_s"] < 50


def test_a_folder_that_is_not_a_run_is_left_alone(tmp_path):
    (tmp_path / "precious.txt").write_text("mine")
    with pytest.raises(RunError, match="is not empty and not a run; give a new name with --out"):
        Run(tmp_path, "test")
    with pytest.raises(RunError, match="is a file"):
        Run(tmp_path / "precious.txt", "test")
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


def test_two_processes_do_not_share_a_folder(tmp_path):
    run = Run(tmp_path / "r", "test")
    with pytest.raises(RunError, match="another besman is working here"):
        Run(tmp_path / "r", "test")
    run.start("", {})
    run.finish()
    Run(tmp_path / "r", "test").start("", {})


def test_a_failed_run_says_so(tmp_path):
    run = Run(tmp_path / "r", "test")
    run.start("", {})
    run.finish("failed", "no markers")
    state = json.loads((tmp_path / "r" / "run.json").read_text())
    assert (state["status"], state["error"]) == ("failed", "no markers")


class Told(Cut):
    """A stage that tells what it did, and leaves out one item."""

    leaves_out = True

    def items(self, segments):
        return Items(len(segments.bounds), "cuts")

    def figures(self, result, truth, segments):
        return {"n": len(result.bounds), "before": len(segments.bounds), "margin_s": truth.margin_s}

    def run(self, segments, *, work=Work()):
        work.notes.failures.append(Failure("a:0", "too short"))
        return super().run(segments, work=work)


class ForBothArms(Cut):
    def figures(self, result, truth, segments):
        return {"n": 1}, {"n": 2}


def test_every_stage_tells_its_figures_and_items_also_from_the_cache(tmp_path):
    for _ in range(2):
        run = Run(tmp_path / "r", "test")
        run.start("", {})
        run.truth = Truth(margin_s=0.7)
        one = run.step("one", Told(), START)
        run.step("both", ForBothArms(), one)
        run.prepare("quiet", Told(), one)
        run.finish()
        failed = [{"name": "a:0", "reason": "too short"}]
        assert json.loads((tmp_path / "r" / "results.json").read_text()) == {
            "one": {"n": 2, "before": 1, "margin_s": 0.7, "failed": failed},
            "both": {"n": 1},
            "both_second": {"n": 2},
        }
        rows = json.loads((tmp_path / "r" / "timing.json").read_text())["stages"]
        assert [(row["name"], row["items"], row["unit"]) for row in rows] == [
            ("one", 1, "cuts"),
            ("both", 0, "item"),
            ("quiet", 2, "cuts"),
        ]


def test_learning_is_a_step_with_the_stage_s_config(tmp_path):
    def learn(recordings, truth, work):
        CALLS.append((recordings, truth))
        return recordings[0]

    stage = Cut()
    for _ in range(2):
        run = Run(tmp_path / "r", "test")
        run.start("", {})
        learnt = run.prepare("train", Training(stage, learn, 4), (START,), ())
        run.step("use", stage, learnt)
        run.finish()
    assert len([call for call in CALLS if call == ((START,), ())]) == 1
    stored = json.loads((tmp_path / "r" / "00_train" / "stage.json").read_text())
    assert stored["config"] == stage.model_dump()
    assert [(row["items"], row["unit"]) for row in run.timing] == [(4, "a class"), (0, "item")]
    assert "train" not in run.results
