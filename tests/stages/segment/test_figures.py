from itertools import pairwise

import numpy as np
import pytest

from besman.records import LabelledSegments, Segments
from besman.stages.segment.figures import segment_results


def found(borders, source="a"):
    bounds = np.array(list(pairwise(borders)))
    return Segments(bounds, 0.0, 10.0, source)


def true(borders, source="a"):
    bounds = np.array(list(pairwise(borders)))
    n = len(bounds)
    return LabelledSegments(bounds, ("x",) * n, np.zeros(n), 10.0, source)


def test_borders_are_counted_over_all_recordings():
    results = segment_results((found([0, 20, 50]), found([0, 50])), (None, None), "hand_top", 0.3)
    assert results == {"n_segments": 3, "borders_per_s": 0.1, "marker": "hand_top"}


def test_with_truth_each_border_is_right_or_wrong():
    results = segment_results(
        (found([0, 21, 40, 60, 100]), found([0, 50])),
        (true([0, 20, 40, 80, 100]), None),
        "hand_top",
        0.3,
    )
    # Of three borders each two meet: one exactly, one 0.1 s off.
    assert results["tp"] == 2
    assert results["fp"] == 1
    assert results["f1"] == pytest.approx(2 / 3)
    assert results["median_offset_s"] == pytest.approx(0.05)
    assert results["margin_s"] == 0.3
