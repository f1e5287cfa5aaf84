"""A capture of a simulated arm that is known throughout."""

import pytest
from places import SAMPLE

from besman.evaluation.degradation import GHOST, DegradeRecipe, degrade_recording
from besman.io.recordings.formats import read_recording
from besman.person.marker_set import load_marker_set
from besman.records import Recording


class Unnamed:
    """A recording whose names were taken away, and the truth.

    Parameters
    ----------
    number : int
        Which of the two embedded recordings.
    """

    def __init__(self, number, recipe, seed, frames=slice(0, 1500)):
        marker_set = load_marker_set("right_arm")
        named = read_recording(SAMPLE / f"subject{number}.tsv")
        columns = marker_set.match(named.names, named.source)
        self.markers = tuple(columns)
        self.positions = named.positions[frames, list(columns.values())]
        spoilt = degrade_recording(self.positions, named.rate_hz, recipe, seed)
        self.truth = tuple(
            [self.markers[k] if k != GHOST else "ghost" for k in frame] for frame in spoilt.truth
        )
        self.recording = Recording(
            named.time[frames],
            spoilt.positions,
            (None,) * spoilt.positions.shape[1],
            named.rate_hz,
            "unnamed.tsv",
            named.first_frame,
        )

    def count(self, named):
        """Return samples named right and wrong."""
        right = wrong = 0
        for decision in named.decisions:
            if decision.named:
                true = self.truth[decision.start][decision.trajectory]
                n = decision.stop - decision.start
                right += n * (true == decision.marker)
                wrong += n * (true != decision.marker)
        return right, wrong


@pytest.fixture(scope="session")
def marker_set():
    return load_marker_set("right_arm")


@pytest.fixture(scope="session")
def teacher():
    """A named recording of the other person."""
    return read_recording(SAMPLE / "subject1.tsv")


@pytest.fixture(scope="session")
def clean():
    return Unnamed(2, DegradeRecipe(0.0), 0)


@pytest.fixture(scope="session")
def spoilt():
    return Unnamed(2, DegradeRecipe(0.05, 0.5, gap_mean_s=0.08, gap_max_s=0.2), 4)
