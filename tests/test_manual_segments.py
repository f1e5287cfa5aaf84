import numpy as np

from besman.manual_segments import complete_truth, drop_parts
from besman.records import LabelledSegments


def manual(*rows):
    bounds = np.array([row[:2] for row in rows]).reshape(-1, 2)
    return LabelledSegments(
        bounds, tuple(row[2] for row in rows), np.zeros(len(rows)), 10.0, "a.tsv", 690
    )


def test_parts_are_dropped():
    whole = drop_parts(manual((0, 9, "reach_part"), (0, 20, "reach"), (20, 30, "rest")))
    assert whole.labels == ("reach", "rest")
    assert whole.first_frame == 690


def test_long_stretches_without_a_label_are_idle():
    truth = manual((20, 25, "rest"), (3, 10, "reach"), (24, 40, "reach"), (41, 50, "rest"))
    whole = complete_truth(truth, 56, idle_s=0.25)
    rows = list(zip(whole.bounds.tolist(), whole.labels, strict=True))
    assert rows == [
        ([0, 3], "idle"),
        ([3, 10], "reach"),
        ([10, 20], "idle"),
        ([20, 25], "rest"),
        ([24, 40], "reach"),
        ([41, 50], "rest"),
        ([50, 56], "idle"),
    ]


def test_no_labels_at_all_are_idle():
    whole = complete_truth(manual(), 30, idle_s=0.25)
    np.testing.assert_array_equal(whole.bounds, [[0, 30]])
