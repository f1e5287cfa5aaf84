"""What can be on no person is refused, what is exchanged for a time is said."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from places import REAL_DATA, SAMPLE
from scipy.spatial.transform import Rotation

from besman.exceptions import LabellingError, RecordingWarning
from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import read_recording
from besman.person.marker_set import load_marker_set
from besman.stages.label.methods import LabelAutoConfig
from besman.stages.label.person_check import check_person
from besman.stages.label.stage import LabelConfig

ARM = load_marker_set("right_arm")


@pytest.fixture(scope="module")
def take():
    whole = read_recording(SAMPLE / "subject1.tsv")
    return replace(whole, time=whole.time[:1500], positions=whole.positions[:1500])


def exchange(recording, one, two, rows=slice(None)):
    columns = ARM.match(recording.names, recording.source)
    positions = recording.positions.copy()
    a, b = columns[one], columns[two]
    positions[rows, a] = recording.positions[rows, b]
    positions[rows, b] = recording.positions[rows, a]
    return replace(recording, positions=positions)


def label(recording, config=LabelConfig):
    return config().run((recording,), ARM)


@pytest.mark.parametrize(
    "folder",
    [
        *(
            SAMPLE.parent / name
            for name in ("stick_throw", "stick_throw_calibration", "pick_and_place_calibration")
        ),
        pytest.param(
            REAL_DATA / "pick_and_place",
            marks=pytest.mark.skipif(
                not REAL_DATA.is_dir(), reason="the real recordings are not on this machine"
            ),
        ),
    ],
    ids=lambda folder: folder.name,
)
def test_right_recordings_are_taken_without_a_word(folder):
    for file in find_recordings([folder]):
        recording = read_recording(file)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            label(recording)


@pytest.mark.parametrize("config", [LabelConfig, LabelAutoConfig])
@pytest.mark.parametrize(
    ("scale", "said"),
    [
        (10.0, r"10 times too large: .*, likely mm read as cm"),
        (0.1, r"10 times too small: .*, likely cm read as mm"),
        (1e-3, r"1000 times too small: .*, likely m read as mm"),
    ],
)
def test_a_person_of_a_wrong_unit(take, config, scale, said):
    large = replace(take, positions=scale * take.positions)
    with pytest.raises(LabellingError, match=rf"^subject1.tsv: the person is {said}$") as refused:
        label(large, config)
    assert "shoulder to elbow is" in str(refused.value)
    assert "(people: 0.10 to 0.51 m)" in str(refused.value)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_person_who_lies_or_an_axis_that_is_not_up(take, axis):
    points = take.positions.reshape(-1, 3).copy()
    turned = Rotation.from_euler(axis, 90, degrees=True).apply(points)
    with pytest.raises(
        LabellingError,
        match=r"^subject1.tsv: the back is never upright: it leans [89]\d degrees or more for nine "
        r"tenths of the time, expected at most 60; z has to point up, and the person to stand or "
        r"sit: is another axis up in this file, or are markers of the back exchanged\?$",
    ):
        label(replace(take, positions=turned.reshape(take.positions.shape)))


@pytest.mark.parametrize(
    ("part", "why"),
    [
        ("back", "the right shoulder lies on the other side"),
        ("hand", "the hand is turned as no forearm turns it"),
    ],
)
def test_left_and_right_exchanged(take, part, why):
    left, right = f"{part}_left", f"{part}_right"
    with pytest.raises(
        LabellingError,
        match=rf"^subject1.tsv: {left} and {right} are exchanged throughout: {why}; give each the "
        r"other's name$",
    ):
        label(exchange(take, left, right))
    first = take.first_frame + 500
    with pytest.warns(
        RecordingWarning,
        match=rf"^subject1.tsv: {left} and {right} are exchanged in frames {first} to "
        rf"{first + 39}: {why}$",
    ):
        (labelled,) = label(exchange(take, left, right, slice(500, 540)))
    assert set(labelled.markers) >= set(ARM.required)


def test_a_set_without_roles_is_not_judged(take):
    bare = ARM.model_copy(update={"roles": {}})
    large = replace(take, positions=10.0 * take.positions)
    (labelled,) = LabelConfig().run((large,), bare)
    with pytest.raises(LabellingError, match="10 times too large"):
        check_person(labelled, ARM)
    np.testing.assert_array_equal(
        labelled.marker("elbow"), large.positions[:, ARM.match(take.names, "")["elbow"]]
    )
