"""Two arms, sensor suits, and what they have in common."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.exceptions import RecognitionError
from besman.records import LabelledRecording, LabelledSegments
from besman.stages.recognize.examples import find_candidates
from besman.stages.recognize.features import FEATURE_NAMES, count_channels, extract_features
from besman.stages.recognize.stage import RecognizeConfig

BACK = ("back_top", "back_left", "back_right")
ARM = ("shoulder", "elbow", "hand_top", "hand_left", "hand_right")
BOTH = (*BACK, *(f"right_{n}" for n in ARM), *(f"left_{n}" for n in ARM), "box_back")
SUIT = (
    "t8",
    *(f"{side}_{limb}" for side in ("right", "left") for limb in ("hand", "fore_arm", "upper_arm")),
)


def hands(side):
    return [f"{side}_{name}" for name in ARM[2:]]


def arm(side):
    return (f"{side}_hand_top", f"{side}_elbow", f"{side}_shoulder")


def test_features_of_two_arms_are_those_of_each(make_person):
    recording, truth = make_person("a.tsv", 1, list(BOTH), hands("right") + hands("left"))
    for feature in FEATURE_NAMES:
        both = extract_features(
            recording, truth.bounds, [feature], (*arm("right"), *arm("left")), ["box_back"]
        )
        assert both.shape[2] == sum(count_channels([feature], (*arm("right"), *arm("left"))))
        if feature in ("object_speed", "log_object_speed"):
            continue
        each = [
            extract_features(recording, truth.bounds, [feature], arm(side), ["box_back"])
            for side in ("right", "left")
        ]
        np.testing.assert_allclose(both, np.concatenate(each, axis=2), atol=1e-12)


def test_which_hand_moves_makes_a_class(make_person):
    takes, truths = [], []
    for seed, side in enumerate(("right", "left")):
        move = {f"{side}_forward": (0.3, 0.0, 0.0)}
        recording, truth = make_person(f"{side}.tsv", seed, list(BOTH), hands(side), 6, move)
        takes.append(recording)
        truths.append(truth)
    model = RecognizeConfig(examples_per_class=2).train(tuple(takes), tuple(truths))
    assert model.recipe.markers == (*arm("right"), *arm("left"))
    found = RecognizeConfig().run(tuple(takes), tuple(truths), model)
    assert [one.labels for one in found] == [truth.labels for truth in truths]


def suit(orientations=True, yaw_deg=0.0, offset=(0.0, 0.0, 0.0)):
    """Both forearms rise; the right hand turns its palm up on the way."""
    n = 50
    rest = {
        "t8": (0, 0, 1.3),
        "hand": (0.3, -0.2, 1.1),
        "fore_arm": (0.05, -0.2, 1.1),
        "upper_arm": (0, -0.2, 1.4),
    }
    positions = np.empty((n, len(SUIT), 3))
    for k, name in enumerate(SUIT):
        positions[:, k] = rest.get(name, rest.get(name.partition("_")[2]))
        if name.startswith("left"):
            positions[:, k, 1] *= -1
        if name.endswith("hand"):
            positions[:, k, 2] += np.linspace(0, 0.3, n)
    lab = Rotation.from_euler("z", yaw_deg, degrees=True)
    quaternions = np.tile(lab.as_quat(scalar_first=True), (n, len(SUIT), 1))
    roll = lab * Rotation.from_euler("x", np.linspace(0, np.pi, n)[:, np.newaxis])
    quaternions[:, SUIT.index("right_hand")] = roll.as_quat(scalar_first=True)
    return LabelledRecording(
        np.arange(n) / 60,
        lab.apply(positions.reshape(-1, 3)).reshape(positions.shape) + offset,
        SUIT,
        np.zeros((n, len(SUIT)), dtype=bool),
        60.0,
        "a.mvnx",
        orientations=quaternions if orientations else None,
    )


MARKERS = ("right_hand", "right_fore_arm", "right_upper_arm", "left_hand")


@pytest.mark.parametrize("feature", [n for n in FEATURE_NAMES if "object" not in n])
def test_features_of_a_suit_do_not_depend_on_where_the_person_stands(feature):
    here = extract_features(suit(), [(0, 50)], [feature], MARKERS)
    there = extract_features(suit(yaw_deg=70, offset=(2, -3, 0.1)), [(0, 50)], [feature], MARKERS)
    assert here.shape == (1, 25, sum(count_channels([feature], MARKERS)))
    np.testing.assert_allclose(here, there, atol=1e-9)


def test_the_orientation_of_a_hand_is_the_suits():
    axes = extract_features(suit(), [(0, 50)], ["hand_orientation"], MARKERS[:3])[0]
    # The fingers of a right hand point to the right where the suit's axes are the laboratory's.
    np.testing.assert_allclose(axes[[0, -1], :3], [[0, -1, 0], [0, 1, 0]], atol=1e-6)
    np.testing.assert_allclose(axes[[0, -1], 3:], [[0, 0, 1], [0, 0, -1]], atol=1e-6)


def test_a_suit_without_orientations_has_positions_alone():
    recording = suit(orientations=False)
    truth = LabelledSegments(np.array([[0, 25], [25, 50]]), ("a", "b"), np.zeros(2), 60.0, "a.mvnx")
    model = RecognizeConfig().train((recording,), (truth,))
    assert "hand_orientation" not in model.recipe.features
    assert RecognizeConfig().run((recording,), (truth,), model)[0].labels == ("a", "b")
    with pytest.raises(RecognitionError, match="hand_orientation needs right_hand's orient"):
        extract_features(recording, [(0, 50)], ["hand_orientation"], MARKERS[:3])
    with pytest.raises(RecognitionError, match="got neither, and there is no other feature"):
        RecognizeConfig(features=("hand_orientation",)).train((recording,), (truth,))


def test_markers_of_an_arm_that_is_not_complete_are_refused(make_person):
    names = [name for name in BOTH if name != "left_elbow"]
    recording, truth = make_person("a.tsv", 1, names, hands("right"))
    with pytest.raises(RecognitionError, match="expected 2: of the arms of right_hand_top, left"):
        extract_features(
            recording, truth.bounds, ["elbow_angle"], ("right_hand_top", "left_hand_top")
        )


def test_a_stretch_in_which_the_hand_moves_is_no_rest(make_person):
    recording, truth = make_person("a.tsv", 1, list(BOTH), hands("right"))
    some = dataclasses.replace(
        truth, bounds=truth.bounds[1:], labels=truth.labels[1:], distances=truth.distances[1:]
    )
    rests = [c for c in find_candidates([recording], [some], 0.25, 0.4) if c.label == "idle"]
    every = [c for c in find_candidates([recording], [some], 0.25, np.inf) if c.label == "idle"]
    assert len(rests) == len(every) - 1
    assert every[0].bounds[0] == 0
    assert rests[0].bounds[0] != 0
