import numpy as np
import pytest

from besman.exceptions import RecordingWarning
from besman.person.marker_set import load_marker_set
from besman.records import LabelledRecording, Recording
from besman.stages.label.derive_markers import derive_markers
from besman.stages.label.stage import LabelConfig
from besman.synthetic.free_throw import simulate_free_throw


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


def test_knuckles_off_their_hand_are_filled_or_go_along_and_both_is_said():
    throw = simulate_free_throw(1).content
    frames = [frame["data"]["player"] for frame in throw["tracking"]]
    names = tuple(frames[0])
    feet = np.array([[frame[name] for name in names] for frame in frames])
    time = np.arange(len(feet)) / 30.0
    marker_set = load_marker_set("spl")
    plain = LabelConfig().take_given(Recording(time, 0.3048 * feet, names, 30.0, "a"), marker_set)
    spoilt = 0.3048 * feet
    spoilt[20:24, names.index("R_1STFINGER")] += [0.0, 0.3, 0.2]
    sides = [names.index("R_1STFINGER"), names.index("R_5THFINGER")]
    spoilt[60:66, sides] = spoilt[60:66, sides[::-1]]
    spoilt[100:, names.index("L_5THFINGER")] += [0.3, 0.0, -0.2]
    with pytest.warns(RecordingWarning) as caught:
        found = LabelConfig().take_given(Recording(time, spoilt, names, 30.0, "a"), marker_set)
    said = [str(one.message) for one in caught]
    assert said[0].endswith("a hand is long became gaps: thumb 6, left_little 39")
    assert said[1].endswith("for a moment were exchanged back: thumb 6, little 6")
    assert said[2].startswith("a: a hand of which a finger is not seen goes along with its forearm")
    for marker, near_m in (("hand_top", 0.03), ("hand_left", 0.03), ("left_hand_top", 0.1)):
        away = np.linalg.norm(found.marker(marker) - plain.marker(marker), axis=1)
        assert away.max() < near_m
        assert away[60:66].max() == 0.0
