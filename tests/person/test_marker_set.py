import pytest

from besman.config.yaml_file import parse_config
from besman.exceptions import ConfigError, LabellingError
from besman.person.marker_set import MarkerSet, load_marker_set, normalise_name

CONTENT = {
    "name": "arm",
    "markers": {"elbow": ["Ellbogen"], "hand_top": [], "stick": []},
    "required": ["elbow", "hand_top"],
    "clusters": {"hand": ["hand_top"]},
    "roles": {"hand": "hand_top"},
    "objects": {"stick": ["stick"]},
}


def make(**changes: object) -> MarkerSet:
    return parse_config(CONTENT | changes, MarkerSet, "arm.yaml")


def test_match_by_name_and_alias_in_the_order_of_the_set():
    names = ["HAND-TOP", None, "other", "ELL BOGEN"]
    assert list(make().match(names, "run.tsv").items()) == [("elbow", 3), ("hand_top", 0)]


@pytest.mark.parametrize("name", ["Hand top", "hand_top", "HANDTOP", "hand - top "])
def test_spelling_does_not_matter(name):
    assert normalise_name(name) == "handtop"


def test_missing_marker_lists_what_is_there():
    with pytest.raises(
        LabellingError,
        match=r"run.tsv: marker 'hand_top' of arm is not there; got: Elbow, Thumb",
    ):
        make().match(["Thumb", "Elbow", None], "run.tsv")
    with pytest.raises(LabellingError, match="got: no named trajectory"):
        make().match([None, None], "run.tsv")


def test_two_trajectories_for_one_marker():
    with pytest.raises(
        LabellingError,
        match=r"run.tsv: trajectories 'Elbow' and 'Ellbogen' both stand for marker 'elbow' of arm",
    ):
        make().match(["Elbow", "Ellbogen", "hand top"], "run.tsv")


@pytest.mark.parametrize("order", [1, -1])
def test_of_a_skeleton_that_has_two_of_a_part_the_first_alias_counts(order):
    """As CMU's database for MotionBuilder: the base of the fingers lies in the wrist."""
    names = ["Hips", "LeftArm", "RightArm", "RightForeArm", "RightHand", "RightFingerBase",
             "RightHandIndex1"][::order]  # fmt: skip
    bvh = load_marker_set("bvh")
    assert names[bvh.find(names, "a.bvh")["index"]] == "RightHandIndex1"
    with pytest.raises(LabellingError, match="both stand for marker 'index' of bvh"):
        bvh.find([*names, "Bob:RightHandIndex1"], "a.bvh")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"markers": {"elbow": [], "hand_top": ["Elbow"]}}, "names both 'elbow' and 'hand_top'"),
        ({"required": ["elbo"]}, "required: no marker 'elbo'; did you mean 'elbow'"),
        ({"clusters": {"back": ["back"]}}, r"clusters.back: no marker 'back'; .*allowed: elb"),
        ({"roles": {"hand": "hand"}}, "roles: no marker 'hand'"),
        ({"objects": {"box": ["box"]}}, "objects.box: no marker 'box'"),
        ({"marker": {}}, "unknown key 'marker'; did you mean 'markers'"),
    ],
)
def test_mistakes_in_the_file(changes, message):
    with pytest.raises(ConfigError, match=message):
        make(**changes)


def test_the_set_that_comes_along():
    markers = load_marker_set("right_arm")
    assert set(markers.required) == {
        "back_top", "back_left", "back_right", "shoulder", "elbow",
        "hand_top", "hand_left", "hand_right",
    }  # fmt: skip
    assert markers.roles == {"shoulder": "shoulder", "elbow": "elbow", "hand": "hand_top"}
    assert markers.objects["stick"] == ("stick",)


def test_own_file_and_no_file(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("name: mine\nmarkers: {hand: []}\nrequired: [hand]\n")
    assert load_marker_set(str(path)).name == "mine"
    with pytest.raises(ConfigError, match=r"no resource named 'left_leg'; .*allowed: .*right_arm"):
        load_marker_set("left_leg")
