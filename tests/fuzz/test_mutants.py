"""Two thousand broken files: each is refused in one line, or read as something that makes sense.

`benchmarks/robustness_of_input.py` does the same with any seed and count, in processes that may
be stopped.
"""

import json
import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from fuzz import attempts, mutations, sense
from fuzz.attempts import GOOD, attempt, read, whole
from fuzz.target import Target
from fuzz.targets import TARGETS
from fuzz.whole_files import head
from homes import few_poses  # noqa: F401
from places import SAMPLE

from besman.exceptions import RecordingError, RecordingWarning
from besman.records import MotionPlan, Recording

SEED, COUNT, BLOCKS = 18, 2000, 20


@pytest.mark.parametrize("name", TARGETS)
def test_whole_files_are_read(name):
    assert whole(name) == ("taken", "")


@pytest.mark.parametrize("block", range(BLOCKS))
def test_no_mutant_ends_in_a_traceback_or_is_taken_without_a_word(block):
    size = COUNT // BLOCKS
    found = [(number, attempt(SEED, number)) for number in range(block * size, (block + 1) * size)]
    assert [one for one in found if one[1].kind not in GOOD] == []
    assert {one.kind for _, one in found} >= {"refused", "taken"}


def test_the_same_seed_gives_the_same_mutants():
    for number in range(5):
        one, other = attempt(3, number), attempt(3, number)
        assert (one.target, one.which, one.kind) == (other.target, other.which, other.kind)


def raising(error, folder):
    raise error


def warning(category, folder):
    warnings.warn("x", category, stacklevel=1)


def busy(folder):
    while True:
        pass


def greedy(folder):
    return np.ones(10**10)


@pytest.mark.parametrize(
    ("reader", "kind"),
    [
        (partial(raising, RecordingError("a.tsv: is cut")), "refused"),
        (partial(raising, ValueError("x")), "traceback"),
        (partial(raising, RecursionError("x")), "traceback"),
        (partial(raising, MemoryError()), "memory"),
        (partial(warning, RecordingWarning), "warned"),
        (partial(warning, RuntimeWarning), "traceback"),
        (busy, "hang"),
        (greedy, "memory"),
        (lambda folder: None, "taken"),
    ],
)
def test_each_outcome_is_told_from_the_others(reader, kind, monkeypatch, tmp_path):
    monkeypatch.setitem(TARGETS, "tsv", Target(dict, {}, reader))
    monkeypatch.setattr(attempts, "LONGEST_S", 0.05)
    assert read("tsv", tmp_path)[0] == kind


def test_what_is_nonsense_counts_unless_it_was_said(monkeypatch, tmp_path):
    judge = {"judge": lambda folder, found: ["a rate of 0 Hz"]}
    monkeypatch.setitem(TARGETS, "tsv", Target(dict, {}, lambda folder: None, **judge))
    assert read("tsv", tmp_path) == ("nonsense", "a rate of 0 Hz")
    loud = Target(dict, {}, partial(warning, RecordingWarning), **judge)
    monkeypatch.setitem(TARGETS, "tsv", loud)
    assert read("tsv", tmp_path)[0] == "warned"


def recording(**changes):
    time = np.arange(20) / 100
    positions = np.zeros((20, 2, 3))
    return replace(Recording(time, positions, ("a", "b"), 100.0, "a.c3d"), **changes)


FAR, FAST = np.zeros((2, 20, 2, 3))
FAR[:, 0] = 1e6
FAST[7, 0] = 5.0


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({}, None),
        ({"positions": FAR}, "coordinates beyond 1 km"),
        ({"positions": FAST}, "faster than sound"),
        ({"rate_hz": 1e-38}, "a rate of 1e-38 Hz"),
        ({"time": np.arange(20) / 10}, "times that do not fit the rate"),
        ({"first_frame": 10**21}, "a frame number that no camera counts to"),
        ({"names": ("a", "\x1b[31m")}, "control characters in a name"),
        ({"names": ("a", "a")}, "names twice or empty"),
        ({"orientations": np.zeros((20, 2, 4))}, "orientations that are none"),
    ],
)
def test_nonsense_in_a_recording_is_seen(changes, problem, tmp_path):
    (tmp_path / "a.c3d").touch()
    found = sense.of_recording(tmp_path, recording(**changes))
    assert found == ([] if problem is None else [problem])


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("\t-213.761", "\t-213.761", None),
        ("\t-213.761", "\t-213.7_61", "digits that are none"),
        ("\t-213.761", "\t-٢13.761", "digits that are none"),
        ("FRAMES\t20", "FRAMES\t1000", "NO_OF_FRAMES that differs"),
        ("FRAMES\t20", "FRAMES\t5", "NO_OF_FRAMES that differs"),
    ],
)
def test_nonsense_in_the_text_is_seen(old, new, problem, tmp_path):
    text = head(SAMPLE / "subject1.tsv", 20)
    assert old in text
    (tmp_path / "a.tsv").write_text(text.replace(old, new))
    found = sense.of_recording(tmp_path, recording())
    assert found[:1] == ([] if problem is None else [problem])


def test_nonsense_in_a_record_is_seen(tmp_path):
    plan = MotionPlan(
        np.ones((2, 3)),
        np.zeros(2),
        np.ones(2),
        1.0,
        ("a", "b"),
        0.0,
        np.ones(7),
        np.ones(3),
        "x",
        "y",
    )
    assert sense.of_record(tmp_path, (plan,)) == []
    assert sense.of_record(tmp_path, replace(plan, weights=np.full((2, 3), np.nan))) == [
        "weights is not finite"
    ]
    assert sense.of_record(tmp_path, replace(plan, name=3)) == ["name of another type"]
    assert sense.of_record(tmp_path, replace(plan, label="a\nb")) == [
        "control characters in a text"
    ]


def test_mutations_break_what_they_are_for():
    """Not a single one leaves the file as it was all the time, and trees stay trees."""
    import random

    rng = random.Random(0)
    for name, target in TARGETS.items():
        for which, change in target.broken.items():
            content = target.files()[which]
            assert any(change(rng, content) != content for _ in range(10)), (name, which)
    content = json.dumps({"a": [1, 2, {"b": "c"}], "d": None}).encode()
    parsed = 0
    for _ in range(200):
        try:
            json.loads(mutations.json_file(rng, content))
            parsed += 1
        except (ValueError, RecursionError):
            continue
    assert 50 < parsed < 200
