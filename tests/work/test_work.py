import pickle
import subprocess
import sys
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
from places import TESTS, TOP

from besman.exceptions import BesmanError, MappingError, RobotError, RunError
from besman.records import Failure, HandTrajectory
from besman.robot.model import load_robot
from besman.work.outcome import Notes
from besman.work.work import Work
from besman.work.workers import Workers

sys.path.insert(0, str(TESTS))

import worker_items


@dataclass(frozen=True)
class Named:
    name: str


def reject_b(item):
    if item.name == "b":
        raise MappingError("b: has no end")
    return item.name.upper()


ITEMS = tuple(Named(name) for name in "abc")


@pytest.fixture(scope="module")
def workers():
    with Workers(2) as workers:
        yield workers


@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_results_come_in_the_order_of_the_items(jobs):
    shares = []
    work = Work(jobs, shares.append)
    assert work.map(worker_items.double, range(40), name=str) == [2 * n for n in range(40)]
    np.testing.assert_allclose(shares, np.arange(1, 41) / 40)
    assert work.map(worker_items.double, []) == []


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_item_that_fails_is_a_row(jobs):
    notes = Notes()
    assert Work(jobs, notes=notes).map(reject_b, ITEMS) == ["A", "C"]
    assert notes.failures == [Failure("b", "has no end")]
    assert str(notes.failures[0]) == "b: has no end"


@pytest.mark.parametrize("jobs", [1, 2])
def test_without_notes_the_first_failure_is_raised(jobs):
    with pytest.raises(MappingError, match=r"^b: has no end$"):
        Work(jobs).map(reject_b, ITEMS)


def test_strict_work_raises_the_first_failure_and_keeps_account():
    notes = Notes()
    with pytest.raises(MappingError, match=r"^b: has no end$"):
        Work(notes=notes, strict=True).map(reject_b, ITEMS)
    assert not notes.failures


def test_if_every_item_fails_that_is_an_error():
    with pytest.raises(MappingError, match=r"^b: has no end$"):
        Work(notes=Notes()).map(reject_b, ITEMS[1:2])
    with pytest.raises(BesmanError, match=r"all 2 failed; the first: 1: ValueError: 1 is odd"):
        Work(notes=Notes()).map(worker_items.refuse_odd, [1, 3], name=str)
    notes = Notes()
    assert Work(notes=notes).map(worker_items.refuse_odd, [1, 3], name=str, some=False) == []
    assert [one.name for one in notes.failures] == ["1", "3"]


def test_parts_of_progress():
    shares = []
    work = Work(progress=shares.append)
    work.part(0.0, 0.5).map(worker_items.double, [1, 2], name=str)
    work.part(0.5, 1.0).part(0.5, 1.0).progress(1.0)
    assert shares == [0.25, 0.5, 1.0]


def test_processes_give_the_same_and_account_for_themselves(workers):
    notes = Notes()
    work = Work(2, notes=notes, workers=workers)
    assert work.map(worker_items.refuse_odd, range(6), name=str, processes=6) == [0, 2, 4]
    assert notes.failures == [Failure(str(n), f"ValueError: {n} is odd") for n in (1, 3, 5)]
    assert 1 <= len(notes.workers) <= 2
    assert all(10 < peak < 1000 for peak in notes.workers.values())
    assert notes.cpu_s >= 0
    few = Notes()
    replace(work, notes=few).map(worker_items.double, range(6), name=str, processes=7)
    assert not few.workers


def test_an_error_that_cannot_be_sent_is_told(workers):
    work = Work(2, workers=workers)
    with pytest.raises(BesmanError, match="OddError: cannot be sent"):
        work.map(worker_items.raise_unsendable, [1, 2], name=str, processes=1)


@pytest.mark.slow
def test_what_died_with_a_process_is_computed_again(workers, tmp_path):
    notes = Notes()
    die = partial(worker_items.die_of, deadly=(3, 4), marks=None)
    once = partial(worker_items.die_of, marks=str(tmp_path))
    work = Work(2, notes=notes, workers=workers)
    assert work.map(once, [0, 1], name=str, processes=1) == [0, 1]
    assert not notes.failures
    assert work.map(die, range(9), name=str, processes=1) == [0, 1, 2, 5, 6, 7, 8]
    assert [one.name for one in notes.failures] == ["3", "4"]
    assert "the worker process died of it, alone with it 2 times" in notes.failures[0].reason


def test_a_process_with_other_code_is_refused(workers, monkeypatch):
    monkeypatch.setattr("besman.work.spread.environment", lambda: {"numpy": "1.0"})
    work = Work(2, notes=Notes(), workers=workers)
    message = r"worker .*:\d+ has numpy \d+\..*; expected what .*: numpy 1\.0"
    with pytest.raises(RunError, match=message):
        work.map(worker_items.double, [1, 2], name=str, processes=1)


def test_a_record_is_read_only_in_another_process():
    hand = HandTrajectory(np.arange(3), np.asfortranarray(np.ones((3, 7))), "a", "throw")
    sent = pickle.loads(pickle.dumps(hand))
    assert sent.poses.tobytes() == hand.poses.tobytes()
    assert not sent.poses.flags.writeable
    assert sent.poses.flags.c_contiguous
    assert (sent.name, sent.label) == ("a", "throw")


def test_a_robot_is_sent_by_its_name_and_loaded_once():
    robot = load_robot("ur5", "stick_holder")
    sent = pickle.dumps(robot)
    assert len(sent) < 500
    again = pickle.loads(sent)
    assert again is pickle.loads(sent)
    assert again.chain.tip.tobytes() == robot.chain.tip.tobytes()
    slow = replace(robot, limits=replace(robot.limits, velocity=0.5 * robot.limits.velocity))
    with pytest.raises(RobotError, match=r"ur5: robot ur5 \(tool stick_holder\) is not what it is"):
        pickle.loads(pickle.dumps(slow))


def test_peak_memory_is_this_process():
    # In one of its own: this one has had more than a test should ask for.
    said = """
from besman.work.in_worker import peak_rss_mb

before = peak_rss_mb()
block = b"1" * 50_000_000
print(before, peak_rss_mb())
"""
    done = subprocess.run(
        [sys.executable, "-c", said], capture_output=True, text=True, check=True, cwd=TOP
    )
    before, after = map(float, done.stdout.split())
    assert before > 10
    assert 40 < after - before < 60
