"""The examples of the tutorial run, and print what the documentation says they show."""

from __future__ import annotations

import contextlib
import io
import os
import re
import runpy
import subprocess
import sys
import warnings
from pathlib import Path

import pytest
from places import TOP

EXAMPLES = TOP / "examples"
# What Python does not print of itself.
UNSAID = (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning)


def run(name: str) -> str:
    """Return what an example prints."""
    said, complaints = io.StringIO(), io.StringIO()
    with (
        warnings.catch_warnings(record=True) as warned,
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(complaints),
    ):
        warnings.simplefilter("always")
        for kind in UNSAID:
            warnings.simplefilter("ignore", kind)
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    assert complaints.getvalue() == ""
    assert [str(one.message) for one in warned] == []
    return said.getvalue()


def run_alone(name: str) -> str:
    """Return what an example prints in a process of its own."""
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name)],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(TOP)},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def figures(pattern: str, text: str) -> list[float]:
    """Return the numbers that a pattern with one group finds."""
    found = [float(number) for number in re.findall(pattern, text)]
    assert found, text
    return found


def test_all_examples_are_tested_and_in_the_tutorial():
    names = sorted(path.name for path in EXAMPLES.glob("*.py"))
    assert len(names) == 7
    page = (TOP / "docs/tutorial.md").read_text()
    here = Path(__file__).read_text()
    for name in names:
        assert f'"{name}"' in here
        assert f"../examples/{name}" in page
        assert f"{{example-output}} {name}" in page


def test_segment_a_recording():
    text = run_alone("01_segment_a_recording.py")
    # Eight throws of three movements each, and a rest before, between and after them.
    assert "33 pieces, 9 of them rests" in text
    assert figures(r"F1 ([\d.]+)", text)[0] > 0.99


def test_name_markers():
    text = run("02_name_markers.py")
    right, wrong = (figures(rf"([\d.]+)% {word}", text)[0] for word in ("named right", "wrong"))
    assert right > 95
    assert wrong < 0.5


def test_recognize_movements():
    text = run("03_recognize_movements.py")
    assert "33 of 33 manual segments have their label" in text
    assert "read back: True" in text


@pytest.mark.slow
def test_map_to_a_robot():
    text = run("04_map_to_a_robot.py")
    assert text.count("4 of 4 transferred") == 3
    assert figures(r"(\d+) beyond a limit", text) == [0, 0, 0]
    # 5 mm are allowed, and a little for the joints' smoothing.
    assert max(figures(r"mean [\d.]+ mm, most ([\d.]+) mm", text)) < 6
    _, changed, kept = figures(r"person's: median ([\d.]+)", text)
    assert kept > changed + 0.2


@pytest.mark.slow
def test_imitate_and_refine():
    text = run("05_imitate_and_refine.py")
    assert text.count(": hit") == 2
    assert max(figures(r"([\d.]+) cm from the target: hit", text)) <= 5
    assert "0 of" in text.split("another goal:")[1].splitlines()[0]


@pytest.mark.slow
def test_own_robot_task_and_template():
    text = run("06_own_robot_task_template.py")
    assert figures(r"refined: ([\d.]+) cm", text)[0] < 10
    assert max(figures(r"misses by ([\d.]+) cm", text)[:2]) < 15
    assert "outside the region that was learnt" in text
    assert text.index("outside") > text.index("target 1.8")


@pytest.mark.slow
def test_whole_task():
    text = run("07_whole_task.py")
    assert "to_shelf: approach_right, move_obj_shelf, move_to_rest_down; box held" in text
    assert len(figures(r"box ([\d.]+) mm beside its place", text)) == 2
    assert figures(r"succeeds, ([\d.]+) mm off", text)[0] < 20
