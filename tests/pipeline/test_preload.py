"""What workers have loaded is there, and is what a run needs."""

import importlib
import sys

from besman.pipeline.preload import PRELOAD
from besman.report.drawings import DRAWING
from besman.robot import loaded_kernels
from besman.robot.collision import _distances


def test_every_module_that_workers_load_is_there():
    # One that is missing would be left out without a word.
    for name in (*PRELOAD, *DRAWING):
        assert importlib.import_module(name) is sys.modules[name]


def test_an_arms_kernels_are_loaded():
    loaded_kernels.load_kernels()
    assert _distances.signatures
