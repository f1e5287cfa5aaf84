"""Which of the libraries that are slow to load each command loads."""

import json
import os
import shutil
import subprocess
import sys

import pytest
from places import SAMPLE, TOP

from besman.cli.main import app

# Each takes from 50 ms to seconds to load; numba's kernels have to be read besides.
SLOW = ("numpy", "scipy", "numba", "sklearn", "pinocchio", "mujoco", "matplotlib")
SLOW += ("matplotlib.pyplot", "scipy.signal", "scipy.stats", "scipy.interpolate", "scipy.optimize")
SLOW += ("cma", "dask", "joblib", "torch", "pymoo")

ALLOWED = {
    "--help": set(),
    "run --help": set(),
    "evaluate --help": set(),
    "info": set(),
    "look RECORDING": {"numpy"},
    "markers new RECORDING": {"numpy"},
    "segment RECORDING": {"numpy"},
    "check PIPELINE": {"numpy", "pinocchio"},
    "robots": {"numpy", "pinocchio"},
    "robots ur5": {"numpy", "pinocchio"},
    "robots check ur5": {"numpy", "pinocchio", "numba", "scipy"},
    "train RECORDINGS": {"numpy", "scipy"},
    "label-markers RECORDING": {"numpy", "numba", "scipy"},
    "report RUN, to be drawn": {"numpy", "pinocchio", "matplotlib"},
    "report RUN, drawn before": {"numpy"},
}

# One process loads what all commands share, and before those that may load numpy, and pinocchio,
# these two; a copy of it runs each of them.
SCRIPT = """
import importlib, json, os, sys
from besman.cli import main

slow, commands = json.load(sys.stdin)
for name, arguments, before in commands:
    for library in before:
        importlib.import_module(library)
    sys.stdout.flush()
    if os.fork() == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.argv = ["besman", *arguments]
        code = 0
        try:
            main.main()
        except SystemExit as end:
            code = end.code or 0
        loaded = [library for library in slow if library in sys.modules]
        print(json.dumps([name, code, loaded]), file=sys.stderr, flush=True)
        os._exit(0)
    os.wait()
"""


@pytest.fixture(scope="module")
def loaded(small_run, tmp_path_factory):
    """Return for every command its exit code and what it loaded."""
    folder = tmp_path_factory.mktemp("loads")
    run = folder / "run"
    shutil.copytree(small_run, run)
    shutil.copytree(run, folder / "drawn")
    (run / "figures.json").unlink()
    recording, unnamed = SAMPLE / "subject1.tsv", TOP / "data/pick_and_place_unlabelled"
    named = TOP / "data/pick_and_place_calibration/person.tsv"
    out = ("--out", folder / "named.tsv", "--learn-from", named)
    arguments = {
        "look RECORDING": ("look", recording),
        "markers new RECORDING": ("markers", "new", recording, "--out", folder / "set.yaml"),
        "segment RECORDING": ("segment", recording),
        "check PIPELINE": ("check", "ur5_stick_throw"),
        "train RECORDINGS": ("train", SAMPLE, "--out", folder / "model"),
        "label-markers RECORDING": ("label-markers", unnamed / "subject1.tsv", *out),
        "report RUN, to be drawn": ("report", run),
        "report RUN, drawn before": ("report", folder / "drawn"),
    }
    shared = {"numpy", "pinocchio"}
    commands = [
        (name, [*map(str, arguments.get(name, name.split()))], sorted(allowed & shared))
        for name, allowed in ALLOWED.items()
    ]
    commands.sort(key=lambda one: len(one[2]))
    # The tests' own measuring of coverage would load more.
    environment = {key: value for key, value in os.environ.items() if "COV" not in key}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        input=json.dumps([SLOW, commands]),
        capture_output=True,
        text=True,
        check=True,
        cwd=TOP,
        env=environment,
    )
    answers = [json.loads(line) for line in done.stderr.splitlines() if line.startswith("[")]
    return {name: (code, set(libraries)) for name, code, libraries in answers}


@pytest.mark.parametrize("command", ALLOWED)
def test_nothing_that_a_command_does_not_use_is_loaded(loaded, command):
    code, libraries = loaded[command]
    assert code == 0
    assert libraries <= ALLOWED[command]


def test_what_is_loaded_is_seen(loaded):
    assert loaded["check PIPELINE"][1] >= {"numpy", "pinocchio"}
    assert "numba" in loaded["robots check ur5"][1]
    assert "matplotlib" in loaded["report RUN, to be drawn"][1]


def test_annotations_of_commands_are_no_texts():
    # Typer reads those of all commands at every start, twice: a sixth of a short command's time.
    groups = [app, *(group.typer_instance for group in app.registered_groups)]
    commands = [one.callback for group in groups for one in group.registered_commands]
    assert len(commands) > 30
    texts = {
        one.__name__: [name for name, kind in one.__annotations__.items() if isinstance(kind, str)]
        for one in commands
    }
    assert {name: found for name, found in texts.items() if found} == {}
