import numpy as np

from besman.config.stage import Truth
from besman.records import LabelledSegments, Segments
from besman.stages.segment.figures import segment_results
from besman.stages.segment.hand_segmentation import SegmentingStage

BOUNDS = np.array([[0, 20], [20, 50]])


class Halves(SegmentingStage):
    """Any method: only what all of them share is looked at."""

    method: str = "halves"

    def run(self, recordings, work=None):
        """Cut nothing: it is not called."""
        raise AssertionError


def test_recordings_are_counted_and_the_figures_name_the_first_marker():
    stage = Halves(markers=("elbow", "hand_top"))
    segments = (Segments(BOUNDS, 0.0, 10.0, "a"),)
    truth = LabelledSegments(
        BOUNDS + np.array([[0, 2], [2, 0]]), ("x", "y"), np.zeros(2), 10.0, "a"
    )
    assert stage.items(("one", "two")) == (2, "recordings")
    found = stage.figures(segments, Truth((truth,), margin_s=0.2), ())
    assert found == segment_results(segments, (truth,), "elbow", 0.2)
    assert (found["marker"], found["tp"], found["margin_s"]) == ("elbow", 1, 0.2)
    assert stage.figures(segments, Truth((truth,), margin_s=0.1), ())["tp"] == 0
