import gc
import importlib
import json
import subprocess
import sys

import pytest
from places import TOP

from besman.work import garbage, in_worker, loaded_last
from besman.work.garbage import collect_seldom


@pytest.fixture
def thresholds():
    """What it was, to be so again."""
    before = gc.get_threshold()
    yield before
    gc.set_threshold(*before)


def n_collections():
    """Count the looks at garbage, of any age: the older is looked for with the young."""
    return sum(one["collections"] for one in gc.get_stats())


def test_young_garbage_is_looked_for_seldom_but_is(thresholds):
    gc.set_threshold(700, 10, 10)
    collect_seldom()
    assert gc.isenabled()
    assert gc.get_threshold() == (50_000, *gc.get_threshold()[1:])
    found = n_collections()
    kept = [[] for _ in range(60_000)]
    assert n_collections() - found in (1, 2)
    assert len(kept) == 60_000


def test_a_worker_looks_as_seldom_and_ends_with_its_parent(thresholds, monkeypatch):
    gc.set_threshold(700, 10, 10)
    told = []
    monkeypatch.setattr(in_worker, "end_with_parent", lambda: told.append(gc.get_threshold()[0]))
    in_worker.begin_worker()
    assert told == [50_000]


def test_what_is_loaded_last_keeps_all_once(monkeypatch):
    asked = []
    monkeypatch.setattr(garbage, "keep_all", lambda: asked.append(True))
    importlib.reload(loaded_last)
    assert asked == [True]


# In a process that has little: to look through what the tests have loaded takes seconds.
SCRIPT = """
import gc, importlib, json
from besman.work import loaded_last
from besman.work.garbage import keep_all, keep_meanwhile

def look():
    cycle = []
    cycle.append(cycle)
    del cycle
    before = gc.get_freeze_count()
    with keep_meanwhile():
        found = gc.get_freeze_count(), gc.collect()
    return before, *found, gc.get_freeze_count()

gc.unfreeze()
told = {"none kept": look()}
keep_all()
told["kept"] = gc.get_freeze_count(), len(gc.get_objects())
told["others kept some"] = look()
gc.unfreeze()
importlib.reload(loaded_last)
told["loaded last"] = gc.get_freeze_count()
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def told():
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True, cwd=TOP
    )
    return json.loads(done.stdout)


def test_what_is_kept_is_not_looked_through(told):
    found, left = told["kept"]
    assert found > 5_000
    assert left < found / 10
    assert told["loaded last"] > 5_000


def test_what_is_kept_meanwhile_goes_back_unless_others_had_kept_some(told):
    before, meanwhile, garbage, after = told["none kept"]
    assert before == after == garbage == 0
    assert meanwhile > 5_000
    before, meanwhile, garbage, after = told["others kept some"]
    assert 0 < before < meanwhile
    assert garbage == 0
    assert after > 0
