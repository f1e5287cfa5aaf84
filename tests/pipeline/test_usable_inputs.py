"""One bad take among several does not end a run, where the config says so."""

import warnings

import numpy as np
import pytest
from free_throws import write_throws
from places import TOP

from besman.exceptions import LabellingError, RecordingWarning
from besman.person.marker_set import load_marker_set
from besman.pipeline.check import check_pipeline
from besman.pipeline.config import load_pipeline
from besman.pipeline.usable_inputs import keep_usable
from besman.stages.label.methods import DefaultLabelConfig
from besman.stages.read.read_inputs import read_inputs

RECIPE = TOP / "pipelines" / "ur5_free_throw.yaml"


def hide(content, name="R_ELBOW"):
    for frame in content["tracking"][20:60]:
        frame["data"]["player"][name] = [float("nan")] * 3
    return content


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("takes")
    write_throws(folder, 2)
    write_throws(folder, 1, hide)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return folder, read_inputs([str(folder)])


def test_a_take_that_cannot_be_labelled_is_left_out(inputs):
    _, read = inputs
    markers = load_marker_set("spl")
    strict, label = (DefaultLabelConfig(markers="spl", leave_out=one) for one in (False, True))
    assert keep_usable(strict, read, markers) == (read, {})
    with pytest.warns(RecordingWarning, match=r"left out: BB_FT_P0001_T0001\.json: marker 'elbow'"):
        kept, left_out = keep_usable(label, read, markers)
    assert [one.source for one in kept.recordings] == ["BB_FT_P0001_T0002.json"]
    assert len(kept.truth) == len(kept.names) == 1
    assert list(left_out) == ["BB_FT_P0001_T0001.json"]


def test_if_none_is_left_the_first_fault_is_said(tmp_path):
    write_throws(tmp_path, 2, hide)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        read = read_inputs([str(tmp_path)])
    label = DefaultLabelConfig(markers="spl", leave_out=True)
    with pytest.raises(LabellingError, match="marker 'elbow' is not seen in frames 20 to 59"):
        keep_usable(label, read, load_marker_set("spl"))


@pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
def test_the_recipe_for_free_throws_says_so(inputs):
    folder, _ = inputs
    assert load_pipeline(RECIPE, (f"recordings={folder}",)).label.leave_out
    lines = check_pipeline(str(RECIPE), (f"recordings={folder}",))
    assert any(line.startswith("recordings: 1, ") for line in lines)
    assert "left out, as they cannot be used: BB_FT_P0001_T0001.json" in lines


def test_fingers_that_are_never_seen_are_as_fingers_that_are_not_there(tmp_path):
    def blind(content):
        for frame in content["tracking"]:
            for name in frame["data"]["player"]:
                if name.endswith("FINGER"):
                    frame["data"]["player"][name] = [float("nan")] * 3
        return content

    def bare(content):
        for frame in content["tracking"]:
            player = frame["data"]["player"]
            for name in [one for one in player if one.endswith("FINGER")]:
                del player[name]
        return content

    hands = []
    for number, change in enumerate((blind, bare)):
        folder = tmp_path / str(number)
        folder.mkdir()
        write_throws(folder, 1, change)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read = read_inputs([str(folder)])
            markers = load_marker_set("spl")
            (labelled,) = DefaultLabelConfig(markers="spl").run(read.recordings, markers, None)
        hands.append(labelled.marker("hand_top"))
    assert np.isfinite(hands[0]).all()
    np.testing.assert_array_equal(*hands)
