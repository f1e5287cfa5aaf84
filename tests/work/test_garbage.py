import gc
import importlib

import pytest

from besman.work import in_worker, loaded_last
from besman.work.garbage import collect_seldom, keep_all, keep_meanwhile


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


def test_what_is_kept_is_not_looked_through(thresholds):
    keep_all()
    found = gc.get_freeze_count()
    assert found > 10_000
    assert len(gc.get_objects()) < found / 10
    gc.unfreeze()
    importlib.reload(loaded_last)
    assert gc.get_freeze_count() > 10_000


@pytest.mark.parametrize("others_keep", [False, True])
def test_what_is_kept_meanwhile_goes_back_unless_others_had_kept_some(others_keep):
    gc.unfreeze()
    if others_keep:
        keep_all()
    cycle = []
    cycle.append(cycle)
    del cycle
    found = gc.get_freeze_count()
    assert (found > 0) == others_keep
    with keep_meanwhile():
        assert gc.get_freeze_count() > found
        assert gc.collect() == 0
    assert (gc.get_freeze_count() > 0) == others_keep
