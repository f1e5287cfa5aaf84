import os
import pickle

import pytest
import worker_items

from besman.work.processes import ProcessPool
from besman.work.versions import environment


@pytest.fixture(scope="module")
def pool():
    one = ProcessPool(1)
    yield one
    one.close()


def call(function):
    return pickle.dumps((environment(), function))


def test_an_item_is_worked_on_in_another_process(pool):
    outcome = pickle.loads(pool.submit(call(worker_items.double), pickle.dumps(4)).result(60))
    assert outcome.value == 8
    assert pool.window == 2


def test_a_pool_that_is_broken_starts_again_with_the_next_item(pool):
    deadly = pool.submit(call(os._exit), pickle.dumps(1))
    with pytest.raises(pool.lost):
        deadly.result(60)
    outcome = pickle.loads(pool.submit(call(worker_items.double), pickle.dumps(5)).result(60))
    assert outcome.value == 10
