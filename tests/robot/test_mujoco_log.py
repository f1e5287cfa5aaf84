import threading
import time
from concurrent.futures import ThreadPoolExecutor

import mujoco

from besman.robot import mujoco_log
from besman.robot.mujoco_log import silence_mujoco


def test_threads_that_begin_together_silence_warnings_once(monkeypatch):
    """MuJoCo's setters of callbacks wait for each other for good, if two threads are in them."""
    calls, together = [], threading.Barrier(4)

    def setter(callback):
        calls.append(callback)
        time.sleep(0.05)

    def begin(_):
        together.wait()
        silence_mujoco()

    mujoco_log._silence_once.cache_clear()
    monkeypatch.setattr(mujoco, "set_mju_user_warning", setter)
    with ThreadPoolExecutor(4) as threads:
        list(threads.map(begin, range(4)))
    monkeypatch.undo()
    mujoco_log._silence_once.cache_clear()
    assert len(calls) == 1
