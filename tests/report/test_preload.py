"""What workers have loaded to draw is there."""

import importlib
import sys

import pytest

from besman.report.preload import DRAWING


@pytest.mark.parametrize("name", DRAWING)
def test_every_module_that_draws_is_there(name):
    # One that is missing would be left out without a word.
    assert importlib.import_module(name) is sys.modules[name]
