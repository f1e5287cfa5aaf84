"""What is said of run folders: which there are, whether they are whole, what is no part of them."""

import io
import os
import shutil
import signal

import pytest
from rich.console import Console

from besman.config.ranges import check_values, range_of
from besman.exceptions import RunError, StoppedError
from besman.pipeline.check_run import check_run
from besman.pipeline.derived_files import stale_files
from besman.pipeline.runs import find_removable, list_runs, remove
from besman.pipeline.stored_run import open_run
from besman.report.runs_table import runs_table
from besman.work.stopping import stops_on_signals


@pytest.fixture
def run(small_run, tmp_path):
    return shutil.copytree(small_run, tmp_path / "runs" / "small")


def test_runs_of_a_folder_are_listed(run):
    (found,) = list_runs(run.parent)
    assert found.status == "done"
    console = Console(width=200, file=io.StringIO())
    console.print(runs_table((found,), run.parent))
    assert "small" in console.file.getvalue()
    with pytest.raises(RunError, match="there is no such folder; expected a folder of runs"):
        list_runs(run / "no")


def test_an_export_that_was_cut_is_noticed(run):
    assert check_run(run)[1] == []
    assert stale_files(open_run(run)) == []
    table = next((run / "exports").glob("*.csv"))
    table.write_bytes(table.read_bytes()[:-20])
    (fault,) = check_run(run)[1]
    assert table.name in fault


def test_what_is_no_part_of_a_run_is_named_and_removed(run):
    (run / "07_other").mkdir()
    (run / "07_other" / "stage.json").write_text("{}")
    found = find_removable(run)
    assert [one.path.name for one in found] == ["07_other"]
    remove(run, found)
    assert not (run / "07_other").exists()
    assert check_run(run)[1] == []


def test_a_signal_stops_with_its_name():
    with pytest.raises(StoppedError, match="SIGTERM"), stops_on_signals(lambda error: None):
        os.kill(os.getpid(), signal.SIGTERM)


def test_a_value_beyond_its_range_is_refused():
    wide = range_of("pause_s")
    check_values("pause_s", 1.0)
    with pytest.raises(ValueError, match="expected"):
        check_values("pause_s", 1e300)
    assert wide.high < 1e300
