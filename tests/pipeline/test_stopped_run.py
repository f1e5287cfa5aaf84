"""Runs that are stopped from outside, in threads and in processes."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest
from places import TESTS, TOP
from small_runs import state_of

from besman.pipeline.run_lock import is_locked
from besman.pipeline.stored_run import open_run

SCRIPT = """
import signal, sys
from besman.cli import main
from besman.config.stage import Stage, Work
from besman.pipeline import pipeline
import worker_items

# Whoever runs tests in the background has told them not to hear Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)
FUNCTION, PROCESSES, MARKS, OUT = sys.argv[1:]

class Slow(Stage):
    method: str = "slow"
    keeps_checkpoints = True

    def run(self, folder, work=Work()):
        (work.checkpoints / "kept").touch()
        function = getattr(worker_items, FUNCTION)
        return tuple(work.map(function, [folder] * 4, name=str, processes=int(PROCESSES)))

def run_stages(config, run, *others):
    run.step("slow", Slow(), MARKS)

pipeline._run_stages = run_stages
sys.argv = ["besman", "run", "ur5_stick_throw", "--jobs", "2", "--out", OUT]
main.main()
"""


def lives(process):
    """Tell whether it has not ended; it may do so while it is asked."""
    try:
        return process.is_running() and process.status() != "zombie"
    except psutil.NoSuchProcess:
        return False


def wait_for(condition):
    until = time.monotonic() + 240
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.02)


@pytest.mark.parametrize(
    ("function", "processes", "number"),
    [
        ("mark_and_compute", 0, signal.SIGINT),
        ("mark", 1, signal.SIGTERM),
        ("mark", 1, signal.SIGKILL),
    ],
)
def test_a_stopped_run_says_so_and_leaves_nobody_behind(tmp_path, function, processes, number):
    (tmp_path / "marks").mkdir()
    out = tmp_path / "run"
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, function, str(processes), tmp_path / "marks", out],
        env={**os.environ, "PYTHONPATH": f"{TOP}:{TESTS}", "OPENBLAS_NUM_THREADS": "1"},
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_for(lambda: len(list((tmp_path / "marks").iterdir())) == 2 or process.poll() is not None)
    assert process.poll() is None, process.communicate()[1]
    started = psutil.Process(process.pid).children(recursive=True)
    process.send_signal(number)
    _, said = process.communicate()
    assert "Traceback" not in said
    assert not is_locked(out)
    assert len(list(out.glob(".*.going/*/kept"))) == 1
    if number == signal.SIGKILL:
        assert open_run(out).status == "killed"
    else:
        name = "Ctrl-C" if number == signal.SIGINT else number.name
        assert process.returncode == 128 + number
        last = said.strip().splitlines()[-1]
        assert last == f"besman: stopped by {name}; the same command goes on from here"
        assert (state_of(out)["status"], state_of(out)["error"]) == (
            "failed",
            f"stopped by {name}",
        )
    wait_for(lambda: not any(map(lives, started)))
