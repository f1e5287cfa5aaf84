import pytest
from browser import open_page, open_shared, pytest_runtest_teardown  # noqa: F401

from besman.view.export import write_replay
from besman.view.run_content import RunContent


@pytest.fixture(scope="session")
def content(small_run):
    return RunContent(small_run)


@pytest.fixture(scope="session")
def replay(content, tmp_path_factory):
    """Write the run as one file."""
    path = tmp_path_factory.mktemp("replay") / "replay.html"
    write_replay(content, path)
    return path
