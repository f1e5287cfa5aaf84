"""Segments in the back frame, against each sample brought there by itself."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.exceptions import RecognitionError
from besman.geometry.frames import back_frame
from besman.stages.recognize.stretches import cut_stretch


@pytest.fixture(scope="module")
def case(one_arm):
    recordings, truth = one_arm
    return recordings[0], truth[0].bounds


def test_paths_are_those_of_the_samples_seen_from_the_back(case):
    recording, bounds = case
    start, end = bounds[1]
    n = int(end - start)
    stretch = cut_stretch(recording, bounds[1:2], ("hand_top", "elbow"), (), n)
    back = [recording.marker(name)[start] for name in stretch.back]
    rotation, origin = back_frame(*back)
    for name in ("hand_top", "elbow"):
        expected = (recording.marker(name)[start:end] - origin) @ rotation
        np.testing.assert_allclose(stretch.paths[name][0], expected, atol=1e-9)
    assert stretch.step_s[0] == pytest.approx(1 / recording.rate_hz)


def test_where_the_person_stands_does_not_matter(case):
    recording, bounds = case
    turn = Rotation.from_euler("Z", 70, degrees=True).as_matrix()
    moved = dataclasses.replace(recording, positions=recording.positions @ turn.T + [2.0, -1, 0])
    one, other = (cut_stretch(r, bounds, ("hand_top",), (), 12) for r in (recording, moved))
    np.testing.assert_allclose(one.paths["hand_top"], other.paths["hand_top"], atol=1e-9)


def test_speed_and_centroid_are_those_of_the_paths(case):
    recording, bounds = case
    stretch = cut_stretch(recording, bounds, ("hand_left", "hand_right"), (), 50)
    path = stretch.paths["hand_left"]
    step = np.linalg.norm(np.diff(path, axis=1), axis=2) / stretch.step_s[:, None]
    middle = 0.5 * (stretch.speed(path)[:, 1:, 0] + stretch.speed(path)[:, :-1, 0])
    np.testing.assert_allclose(middle, step, atol=0.1 * step.max())
    np.testing.assert_allclose(
        stretch.object_path(("hand_left", "hand_right")),
        0.5 * (path + stretch.paths["hand_right"]),
    )


def test_what_cannot_be_cut_is_named_with_its_place(case):
    recording, bounds = case
    with pytest.raises(RecognitionError, match=r"0.tsv: no marker 'wrist'; .*allowed"):
        cut_stretch(recording, bounds, ("wrist",), (), 5)
    for rows in ([[5, 6]], [[-1, 5]], [[0, 10**6]]):
        with pytest.raises(RecognitionError, match=r"got segment \[.*; expected at least 2"):
            cut_stretch(recording, rows, ("elbow",), (), 5)
    positions = recording.positions.copy()
    row = int(bounds[2, 0]) + 3
    positions[row, recording.markers.index("elbow")] = np.nan
    dark = dataclasses.replace(recording, positions=positions)
    message = f"marker 'elbow' was not seen in frame {recording.first_frame + row}"
    with pytest.raises(RecognitionError, match=message):
        cut_stretch(dark, bounds, ("elbow",), (), 5)
