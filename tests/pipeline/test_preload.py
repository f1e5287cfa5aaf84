"""What workers have loaded is there, and is what a run needs."""

import importlib
import pickle
import sys

from besman.pipeline.preload import DRAWING, PRELOAD
from besman.robot.collision import _distances
from besman.stages.refine import rehearsal


def test_every_module_that_workers_load_is_there():
    # One that is missing would be left out without a word.
    for name in (*PRELOAD, *DRAWING):
        assert importlib.import_module(name) is sys.modules[name]


def test_what_a_throw_takes_is_there_for_an_arm_that_is_sent():
    robot = rehearsal.rehearse()
    assert _distances.signatures
    assert pickle.loads(pickle.dumps(robot)) is robot
