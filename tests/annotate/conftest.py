import shutil

import pytest
from browser import open_page, pytest_runtest_teardown  # noqa: F401

from besman.annotate.server import make_server
from besman.annotate.session import Session
from besman.synthetic.datasets import write_synthetic


@pytest.fixture(scope="session")
def three_throws(tmp_path_factory):
    """Write a simulated recording of three stick throws, with its segments; return its path."""
    folder = tmp_path_factory.mktemp("throws")
    write_synthetic("stick_throw_marked", folder, n_subjects=1, n_repetitions=3, seed=5)
    (recording,) = folder.glob("*.tsv")
    return recording


@pytest.fixture
def recording_path(three_throws, tmp_path):
    """Copy the recording without its segments."""
    path = tmp_path / "throws.tsv"
    shutil.copy(three_throws, path)
    return path


@pytest.fixture
def segments_path(recording_path):
    return recording_path.with_name("throws_manually_segmented.json")


@pytest.fixture
def truth_path(three_throws):
    """Return the segments of the recording, known from the simulation."""
    return three_throws.with_name(three_throws.stem + "_manually_segmented.json")


@pytest.fixture
def serve():
    """Serve sessions until the test is over."""
    servers = []

    def start(*paths, port=None, **options):
        server = make_server(Session(paths, **options), port)
        server.start()
        servers.append(server)
        return server

    yield start
    for server in servers:
        server.stop()
