import numpy as np

from besman.records import LabelledSegments
from besman.records.layers import (
    actions_of,
    building_blocks,
    complete_truth,
    drop_parts,
    hand_side,
    side_of,
    stack_layers,
)


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


BOTH = stack_layers(
    {
        "right_hand": manual((0, 5, "reach"), (5, 9, "hold")),
        "left_hand": manual((2, 9, "lift")),
        "actions": manual((0, 9, "turn")),
    }
)


def test_layers_tell_blocks_from_actions():
    assert building_blocks(BOTH).labels == ("reach", "hold")
    assert building_blocks(BOTH, "left").labels == ("lift",)
    assert actions_of(BOTH).labels == ("turn",)
    assert hand_side([BOTH]) == "right"
    assert hand_side([building_blocks(BOTH, "left")]) == "left"
    # What has been chosen once stays chosen.
    assert building_blocks(building_blocks(BOTH, "left"), "left").labels == ("lift",)


def test_without_layers_every_segment_may_be_either():
    flat = manual((0, 5, "reach"), (0, 9, "turn"))
    assert building_blocks(flat) is flat
    assert actions_of(flat) is flat
    assert hand_side([flat]) is None


def test_blocks_may_be_in_no_layer_beside_actions():
    some = stack_layers({"": manual((0, 5, "reach")), "actions_2": manual((0, 9, "turn"))})
    assert building_blocks(some, "left").labels == ("reach",)
    assert actions_of(some).labels == ("turn",)
    assert building_blocks(stack_layers({"actions": manual((0, 9, "turn"))})) is None


def test_completed_segments_have_no_layers():
    blocks = complete_truth(building_blocks(BOTH), 20, idle_s=0.25)
    assert (blocks.labels, blocks.layers) == (("reach", "hold", "idle"), ())


def test_the_side_of_markers():
    assert side_of(("left_hand_top", "left_elbow")) == "left"
    assert side_of(("left_hand_top", "hand_top")) == side_of(()) == "right"
