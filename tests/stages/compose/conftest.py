import pytest
from steps import step_recording


@pytest.fixture(scope="session")
def make_steps():
    """Make other ones: see `step_recording`."""
    return step_recording


@pytest.fixture(scope="session")
def steps():
    """Six actions to find."""
    return step_recording(["step_up", "step_down"] * 3, seed=1)


@pytest.fixture(scope="session")
def lesson():
    """Two of each action to learn from."""
    return step_recording(["step_up", "step_down"] * 2, seed=2, source="lesson.tsv")
