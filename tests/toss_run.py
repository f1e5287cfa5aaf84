"""A run of throws whose three blocks are one action as well."""

import json

import pytest
from command_line import besman, leave_undrawn
from small_runs import keep_demonstrations

from besman.io.segments_json import find_segments
from besman.synthetic.datasets import write_synthetic

_SETTINGS = (
    "label={method: named}",
    "segment={method: vmci, border_probability: 0.05, longest_s: 5.0}",
    "recognize.examples_per_class=2",
    "compose={levels: [[toss]], examples_per_class: 2, longest_blocks: 12}",
    "select.label=null",
    "select.action=toss",
    "map.evaluations=20",
    "map.yaw=false",
    "map.correct=false",
    "map.greatest_error_m=1.0",
    "refine.episodes=2",
    "refine.robustness=null",
)


def write_tosses(folder):
    """Write throws whose blocks carry the name of an action as well (synthetic)."""
    (path,) = write_synthetic("stick_throw", folder, 1, 3, seed=3)
    file = find_segments(path)
    content = json.loads(file.read_text())
    entries = content if isinstance(content, list) else content["segments"]
    for k in [k for k, entry in enumerate(entries) if entry["label"] == "throw"]:
        toss = {**entries[k], "label": "toss"}
        toss["start index"] = entries[k - 1]["start index"]
        toss["end index"] = entries[k + 1]["end index"]
        entries.append(toss)
    file.write_text(json.dumps(content))
    return path


def run_tosses(folder):
    """Write the capture, and run the default pipeline on it until one toss is refined, undrawn."""
    capture = write_tosses(folder / "capture")
    arguments = ["run", "ur5_stick_throw", "--out", folder / "run"]
    for setting in (f"recordings={capture}", *_SETTINGS):
        arguments += ["--set", setting]
    with pytest.MonkeyPatch.context() as patch:
        leave_undrawn(patch)
        keep_demonstrations(patch, 1)
        assert besman(patch, *arguments) == 0
