"""What workers have loaded is there, and is what a run needs."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from besman.cli.run import _load_ahead
from besman.pipeline.preload import PRELOAD
from besman.report.preload import DRAWING
from besman.work import fork_server


def test_every_module_that_workers_load_is_there():
    # One that is missing would be left out without a word.
    for name in PRELOAD:
        assert importlib.import_module(name) is sys.modules[name]


@pytest.mark.parametrize(
    ("pipeline", "out", "jobs", "cluster", "begun"),
    [
        ("new_one", None, 2, None, True),
        ("there/old.yaml", None, 2, None, False),
        ("new_one", "runs/old", 2, None, False),
        ("new_one", None, 1, None, False),
        ("new_one", None, 2, "tcp://here:1", False),
    ],
)
def test_modules_are_loaded_ahead_for_a_new_run(
    pipeline, out, jobs, cluster, begun, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "old").mkdir(parents=True)
    asked = []
    monkeypatch.setattr(fork_server, "start_server", asked.append)
    _load_ahead(Path(pipeline), None if out is None else Path(out), jobs, cluster)
    assert asked == [(*PRELOAD, *DRAWING)] * begun


def test_the_command_itself_loads_neither_scipy_nor_mujoco_to_map():
    # What needs them is done in the workers, which load them meanwhile: 0.25 s of every run.
    script = (
        "import sys, besman.pipeline.pipeline, besman.stages.map.map_demonstrations\n"
        "slow = ('scipy.interpolate', 'scipy.optimize', 'scipy.linalg', 'mujoco')\n"
        "print([one for one in slow if one in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"
