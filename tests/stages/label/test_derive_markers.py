import numpy as np

from besman.person.marker_set import load_marker_set
from besman.records import LabelledRecording
from besman.stages.label.derive_markers import derive_markers


def test_what_is_derived_stands_after_what_is_worn_and_has_no_orientation():
    names = ("shoulder", "elbow", "wrist", "left_shoulder")
    positions = np.random.default_rng(0).random((6, 4, 3))
    turned = np.tile([1.0, 0.0, 0.0, 0.0], (6, 4, 1))
    given = LabelledRecording(
        np.arange(6) / 50, positions, names, np.zeros((6, 4), bool), 50.0, "a.trc",
        orientations=turned,
    )  # fmt: skip
    found = derive_markers(given, load_marker_set("halpe"))
    assert found.markers == (*names, "back_top", "back_left", "back_right", "hand_top",
                             "hand_left", "hand_right")  # fmt: skip
    np.testing.assert_array_equal(found.positions[:, :4], positions)
    np.testing.assert_array_equal(found.orientations[:, :4], turned)
    assert np.isnan(found.orientations[:, 4:]).all()
    assert not found.filled.any()


def test_a_set_of_clusters_derives_nothing():
    marker_set = load_marker_set("right_arm")
    positions = np.zeros((3, 1, 3))
    given = LabelledRecording(
        np.arange(3) / 50, positions, ("elbow",), np.zeros((3, 1), bool), 50.0, "a"
    )
    assert derive_markers(given, marker_set) is given
