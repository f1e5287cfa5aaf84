import fcntl
import functools
import gc
import os
import shutil

# Before numpy is loaded, as in the command line: threads inside BLAS cost several times the CPU
# time here, because the matrices are small; so do OpenMP's in scikit-learn, which wait by turning.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import keep_bytecode  # noqa: F401
import numpy as np
import pytest
from command_line import leave_undrawn, run_small
from hypothesis import settings

from besman.motion.dmp_fit import fit_weights
from besman.records import MotionPlan
from besman.robot.model import load_robot

# How long an example takes says how busy the machine is.
settings.register_profile("besman", deadline=None)
settings.load_profile("besman")


def pytest_collection_finish(session):
    """Look no more for garbage among what is imported and collected: a twelfth of the suite."""
    gc.collect()
    gc.freeze()


class Unfreezing:
    """Knows whether what was frozen is looked through again; to count it takes a tenth of a s."""

    def __init__(self):
        self.unfreeze, self.done = gc.unfreeze, False
        gc.unfreeze = self

    def __call__(self):
        self.done = True
        self.unfreeze()


UNFREEZING = Unfreezing()


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown():
    """Leave it so: after a test that has what was frozen looked through, all others would pay."""
    if UNFREEZING.done:
        gc.freeze()
        UNFREEZING.done = False


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session):
    """Look once for garbage whose end fails; pytest looks five times more, now through nothing."""
    gc.collect()
    gc.freeze()


START = np.array([1.52, -3.75, 0.54, -1.39, -0.70, -0.12])
GOAL = np.array([2.09, -3.15, 0.33, -2.02, -1.48, -0.62])


def throw(robot, duration=0.53, goal=GOAL, name="a", target=(1.5, -0.6, 0.0)):
    x = np.linspace(0, 1, 61)
    blend = (10 * x**3 - 15 * x**4 + 6 * x**5)[:, None]
    return MotionPlan(
        weights=fit_weights(x, START + blend * (goal - START), 10),
        start=START,
        goal=goal,
        duration=duration,
        joint_names=robot.joint_names,
        rmse=0.0,
        goal_pose=np.array([0.0, 0, 0, 1, 0, 0, 0]),
        target=np.array(target),
        name=name,
        label="throw",
    )


@pytest.fixture(scope="session")
def robot():
    return load_robot("ur5", "stick_holder")


@pytest.fixture(scope="session")
def make_plan(robot):
    """Make a throw of the UR5 that lands about 1.5 m in front of it."""
    return functools.partial(throw, robot)


@pytest.fixture(scope="session")
def made_once(tmp_path_factory):
    """Have a folder filled once for all workers of a session: (name, fill) -> its path."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent

    def make(name, fill):
        made, done = folder / f"made_{name}", folder / f"made_{name}.done"
        # The lock is let go when its process ends, however it ends.
        with (folder / f"made_{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not done.exists():
                shutil.rmtree(made, ignore_errors=True)
                made.mkdir()
                fill(made)
                done.touch()
        return made

    return make


@pytest.fixture(scope="session")
def small_capture(made_once):
    """Recording and segments of a person who throws three times (synthetic); to read only."""
    return made_once("small_run", run_small) / "capture"


@pytest.fixture(scope="session")
def small_run(made_once, tmp_path_factory):
    """Give this worker's own copy of a finished run of `small_capture`."""
    made = made_once("small_run", run_small)
    return shutil.copytree(made / "run", tmp_path_factory.mktemp("small") / "run")


@pytest.fixture(scope="session")
def toss_run(made_once):
    """A folder of a capture of throws, and of a run that finds them as actions; to read only."""
    from toss_run import run_tosses

    return made_once("toss_run", run_tosses)


@pytest.fixture
def undrawn(monkeypatch):
    """Have reports made without rendering their figures."""
    leave_undrawn(monkeypatch)
