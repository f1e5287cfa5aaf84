import importlib
import os
import pickle
import subprocess
import sys

import pytest
import worker_items
from places import TESTS

from besman.work import loaded_code
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
    outcome = pickle.loads(pool.submit(call(worker_items.double), pickle.dumps(4)).result(240))
    assert outcome.value == 8
    assert pool.window == 2


def test_a_pool_that_is_broken_starts_again_with_the_next_item(pool):
    deadly = pool.submit(call(os._exit), pickle.dumps(1))
    with pytest.raises(pool.lost):
        deadly.result(240)
    outcome = pickle.loads(pool.submit(call(worker_items.double), pickle.dumps(5)).result(240))
    assert outcome.value == 10


def test_which_code_it_is_is_asked_before_any_item_comes():
    environment.cache_clear()
    importlib.reload(loaded_code)
    assert environment.cache_info().currsize == 1


SCRIPT = """
print("once")
import worker_items
from besman.work.work import Work
from besman.work.workers import Workers

with Workers(2, preload=["no.such.module", "fractions"]) as workers:
    workers.start()
    print(Work(2, workers=workers).map(worker_items.double, [1, 2], name=str, processes=1))
"""


def test_a_script_that_has_no_guard_is_not_run_again(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    path = os.pathsep.join([str(TESTS), *sys.path])
    done = subprocess.run(
        [sys.executable, tmp_path / "script.py"],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert (done.stdout, done.returncode) == ("once\n[2, 4]\n", 0)
