"""Items over a pool that is made up: it loses what it is told to lose."""

import pickle
from concurrent.futures import Future

import pytest
import worker_items

from besman.exceptions import RunError
from besman.work.in_worker import run_item
from besman.work.spread import spread


class LostError(Exception):
    """The process is gone."""


class Here:
    """A pool that works at once, in this process; deadly items break every process."""

    lost = (LostError,)
    tries = 2
    window = 3

    def __init__(self, deadly=(), kills_neighbours=False):
        self.deadly, self.kills_neighbours = deadly, kills_neighbours
        self.renewed, self.given = 0, []
        self._open = []

    def submit(self, call, item):
        number, future = pickle.loads(item), Future()
        self.given.append(number)
        self._open = [one for one in self._open if not one.done()]
        if number in self.deadly:
            future.set_exception(LostError())
        else:
            future.set_result(run_item(call, item))
        return future

    def renew(self):
        self.renewed += 1

    def check(self):
        pass


def results(pool, items, function=worker_items.double):
    return {at: outcome for at, outcome in spread(pool, function, items)}


def test_every_item_comes_back_once_with_its_index():
    found = results(Here(), range(10))
    assert {at: one.value for at, one in found.items()} == {k: 2 * k for k in range(10)}


def test_an_item_that_kills_its_process_is_tried_alone_and_then_given_up():
    pool = Here(deadly=(4,))
    found = results(pool, range(6))
    assert str(found[4].error).startswith("the worker process died of it, alone with it 2 times")
    assert [found[k].value for k in (0, 1, 2, 3, 5)] == [0, 2, 4, 6, 10]
    # Once in company, twice alone.
    assert pool.given.count(4) == 3
    assert pool.renewed == 3


def test_an_error_of_the_item_is_its_outcome():
    found = results(Here(), range(3), worker_items.refuse_odd)
    assert "is odd" in str(found[1].error)
    assert found[2].value == 2


def test_a_worker_that_cannot_take_work_ends_all(monkeypatch):
    pool = Here()
    monkeypatch.setattr(pool, "submit", lambda call, item: _broken())
    with pytest.raises(RunError, match="a worker cannot take work: OSError: full"):
        results(pool, [1])


def _broken():
    future = Future()
    future.set_exception(OSError("full"))
    return future
