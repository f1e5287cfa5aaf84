import json

import numpy as np
import pytest

from besman.exceptions import LabellingError, RecordingError
from besman.foreign.names import split_subject
from besman.io.recordings.formats import read_recording, write_recording
from besman.io.recordings.subjects import find_subjects, take_subject
from besman.person.marker_set import load_marker_set
from besman.records import Recording
from besman.stages.read.config import ReadConfig
from besman.stages.read.read_inputs import read_inputs

POINTS = {"Nose": 1.7, "Neck": 1.5, "RShoulder": 1.45, "RElbow": 1.2, "RWrist": 1.0,
          "LShoulder": 1.45, "RAnkle": 0.1}  # fmt: skip
CONCLUDING = pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")


def two_people(ball=True):
    names = tuple(f"{who}:{point}" for who in ("Ann", "Bob") for point in POINTS)
    heights = np.array([*POINTS.values(), *POINTS.values()])
    time = np.arange(20) / 50
    positions = np.zeros((20, len(names), 3))
    positions[..., 2] = heights
    positions[:, len(POINTS) :, 0] = 2.0
    positions[..., 1] = 0.1 + np.sin(3 * time)[:, None]
    if ball:
        names, positions = (*names, "ball"), np.concatenate((positions, positions[:, :1]), axis=1)
    return Recording(time, positions, names, 50.0, "a.c3d")


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("Ann:RELB", ("Ann", "RELB")),
        ("RELB", ("", "RELB")),
        ("Skeleton_001_Hip", ("Skeleton_001", "Hip")),
        ("lab:Person 2 Hip", ("lab", "Hip")),
        ("a:b: c", ("a:b", "c")),
    ],
)
def test_whose_a_name_is(name, parts):
    assert split_subject(name) == parts


def test_one_of_two(tmp_path):
    both = two_people()
    assert find_subjects(both.names) == ("Ann", "Bob")
    bob = take_subject(both, "bob", tmp_path)
    assert bob.names == (*(f"Bob:{point}" for point in POINTS), "ball")
    np.testing.assert_array_equal(bob.positions, both.positions[:, len(POINTS) :])
    assert take_subject(both, None, tmp_path) is both
    with pytest.raises(
        RecordingError, match=r"no subject 'Bobby'; did you mean 'Bob'\? allowed: A"
    ):
        take_subject(both, "Bobby", tmp_path)


@CONCLUDING
def test_in_a_recipe_and_around_a_call(tmp_path):
    write_recording(two_people(ball=False), tmp_path / "a.c3d")
    (read,) = read_inputs([str(tmp_path)], config=ReadConfig(subject="Ann")).recordings
    assert find_subjects(read.names) == ("Ann",)
    both = read_recording(tmp_path / "a.c3d")
    with pytest.raises(LabellingError, match="choose with --subject 'Ann' or 'Bob', in a recipe"):
        load_marker_set("halpe").find(both.names, "a.c3d")


def people(identify, flat=False):
    frames = []
    for at in range(12):
        persons = []
        for k in range(2):
            y = 0.1 * at + 0.01
            if flat:
                values = [0.0] * 100
                for place, (_, z) in zip((0, 1, 2, 3, 4, 5, 11), POINTS.items(), strict=True):
                    values[4 * place : 4 * place + 4] = [2.0 * k, y, z, 0.9]
                person = {"pose_keypoints_3d": values}
            else:
                person = {name: [2.0 * k, y, z] for name, z in POINTS.items()}
            persons.append(identify(k) | person)
        frames.append({"people": persons if at % 2 else persons[::-1]})
    return frames


@CONCLUDING
@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize(
    ("identify", "subject"),
    [(lambda k: {"person_id": [k]}, "person1"), (lambda k: {"name": ["Ann", "Bob"][k]}, "Bob")],
)
def test_people_of_keypoints(tmp_path, identify, subject, flat):
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"fps": 30, "frames": people(identify, flat)}))
    found = read_recording(path, units="m", up="z", subject=subject)
    seen = {
        name for at, name in enumerate(found.names) if np.isfinite(found.positions[:, at]).all()
    }
    assert seen == {f"{subject}:{point}" for point in POINTS}
    column = found.names.index(f"{subject}:RWrist")
    np.testing.assert_allclose(found.positions[:, column, 0], 2.0)
    np.testing.assert_allclose(found.positions[:, column, 2], 1.0)


def test_a_flat_list_of_another_length_is_refused(tmp_path):
    path = tmp_path / "a.json"
    frame = {"people": [{"person_id": [3], "pose_keypoints_3d": [1.0] * 8}]}
    path.write_text(json.dumps({"fps": 30, "frames": [frame] * 3}))
    with pytest.raises(RecordingError, match=r"'person3:pose_keypoints_3d' is .*three numbers"):
        read_recording(path)
