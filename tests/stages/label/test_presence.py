"""A body that is not there gets no names; one that is there gets all."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from legs import walking_legs
from places import REAL_DATA

from besman.exceptions import LabellingError
from besman.io.recordings.formats import read_recording
from besman.person.marker_set import load_marker_set
from besman.stages.label.model_from_pose import model_from_pose
from besman.stages.label.presence import find_absence
from besman.stages.label.trajectories import learn_from_recording, name_trajectories

ARM = load_marker_set("right_arm")
needs_real = pytest.mark.skipif(
    not REAL_DATA.is_dir(), reason="the real recordings are not on this machine"
)


@pytest.fixture(scope="module")
def models(teacher):
    return {"pose": model_from_pose(ARM), "teacher": learn_from_recording(teacher, ARM)}


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("known", ["pose", "teacher"])
def test_legs_are_no_arm(models, known, seed):
    with pytest.raises(
        LabellingError, match=rf"^legs{seed}.tsv: marker set right_arm does not fit, nothing is nam"
    ):
        name_trajectories(walking_legs(seed), ARM, models[known], 0.8)


read_once = cache(read_recording)


@cache
def learn_real():
    return learn_from_recording(read_once(REAL_DATA / "pick_and_place/subject1_run1.tsv"), ARM)


def unnamed(path, chosen=None):
    recording = read_once(path)
    columns = [k for k, name in enumerate(recording.names) if not chosen or name[1:3] in chosen]
    return replace(
        recording, positions=recording.positions[:, columns], names=(None,) * len(columns)
    )


@needs_real
@pytest.mark.parametrize("known", ["pose", "teacher", "real"])
@pytest.mark.parametrize(
    ("file", "chosen"),
    [
        ("formats/optitrack_frame0.c3d", None),
        ("c3d/KneeltoProne01.c3d", ("TH", "SH", "AN", "HE", "FT")),
        ("c3d/KneeltoProne01.c3d", ("TH", "SH", "AN", "HE", "FT", "VU", "VL")),
        ("c3d/KneeltoProne01.c3d", None),
        ("c3d/S09_KneeltoRun02.c3d", None),
    ],
)
@pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
def test_real_recordings_without_that_arm(models, known, file, chosen):
    model = learn_real() if known == "real" else models[known]
    with pytest.raises(LabellingError, match="right_arm does not fit, nothing is named"):
        name_trajectories(unnamed(REAL_DATA / file, chosen), ARM, model, 0.8)


@needs_real
@pytest.mark.parametrize("person", ["1", "2"])
def test_real_recordings_of_that_arm_are_named(person):
    other = {"1": "2", "2": "1"}[person]
    folder = REAL_DATA / "pick_and_place"
    model = learn_from_recording(read_once(folder / f"subject{other}_run1.tsv"), ARM)
    for run in (2, 5):
        recording = read_once(folder / f"subject{person}_run{run}.tsv")
        named = name_trajectories(
            unnamed(folder / f"subject{person}_run{run}.tsv"), ARM, model, 0.8
        )
        for marker, column in ARM.match(recording.names, "").items():
            np.testing.assert_array_equal(named.marker(marker), recording.positions[:, column])


@pytest.fixture
def paths(teacher):
    """Markers of an arm that is there."""
    columns = ARM.match(teacher.names, "")
    return {marker: teacher.positions[:400, column] for marker, column in columns.items()}


def reason(paths, models, given=()):
    return find_absence(paths, ARM, models["teacher"], 100.0, given)


def test_an_arm_is_there(paths, models):
    assert reason(paths, models) is None


def test_a_marker_is_missing(paths, models):
    del paths["elbow"]
    assert reason(paths, models) == "7 of 8 required markers found, without elbow"
    assert reason(paths, models, ("shoulder", "back_top", "back_left")) is not None
    assert reason(paths, models, ("shoulder", "back_top", "back_left", "back_right")) is None


def test_a_cluster_that_is_larger_or_not_rigid(paths, models):
    top = paths["back_top"]
    paths["back_top"] = paths["back_left"] + 1.4 * (top - paths["back_left"])
    said = r"^cluster back is not as known: back_top and back_left are 189 mm apart, changing by \d"
    with pytest.raises(AssertionError, match=said):
        raise AssertionError(reason(paths, models))
    wobble = 0.06 * np.sin(np.arange(400) / 10)[:, np.newaxis]
    paths["back_top"] = top + wobble
    assert "changing by" in reason(paths, models)


def test_a_limb_that_nobody_has(paths, models):
    far = paths["elbow"] + [0.0, 0.0, -0.8]
    assert reason({**paths, "elbow": far}, models).startswith("shoulder to elbow is 1.")
    rubber = paths["elbow"] + 0.25 * np.sin(np.arange(400) / 9)[:, np.newaxis] * [0, 0, 1]
    assert reason({**paths, "elbow": rubber}, models).endswith("% of its length")


def test_a_shoulder_on_the_other_side(paths, models):
    left, right = paths["back_left"], paths["back_right"]
    turned = {**paths, "back_left": right, "back_right": left}
    assert reason(turned, models) == (
        "back_left and back_right lie the wrong way round: the right shoulder lies on the other "
        "side"
    )
    # What the recording says itself is said elsewhere.
    assert reason(turned, models, ("back_left", "back_right")) is None
