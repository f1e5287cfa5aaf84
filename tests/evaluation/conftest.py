import pytest
from steps import step_recording


@pytest.fixture(scope="session")
def make_steps():
    """Make two-armed steps: see `step_recording`."""
    return step_recording
