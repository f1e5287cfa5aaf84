"""An arm's home, looked for among few poses where a test is not about it: a third of the time."""

import pytest

from besman.robot.files import standing

_FEW = {"_ROUNDS": 3, "_FIRST_CANDIDATES": 600}
_ALL = {name: getattr(standing, name) for name in _FEW}


@pytest.fixture(scope="module", autouse=True)
def few_poses():
    """Have descriptions come in without a long search, for all tests of a file."""
    with pytest.MonkeyPatch.context() as patch:
        for name, number in _FEW.items():
            patch.setattr(standing, name, number)
        yield


@pytest.fixture
def all_poses(monkeypatch):
    """Look for a home as it is done for users."""
    for name, number in _ALL.items():
        monkeypatch.setattr(standing, name, number)
