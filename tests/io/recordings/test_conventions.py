from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.exceptions import RecordingError, RecordingWarning
from besman.geometry.up_axis import AXES
from besman.io.recordings.conventions import BY_FORMAT, BY_HABIT, leave_out_zeros, turn, turn_up
from besman.io.recordings.format import parse_units, parse_up, reading
from besman.io.recordings.formats import read_recording, write_recording
from besman.records import Origin, Recording

PATH = Path("a.x")
RNG = np.random.default_rng(0)
NAMES = ("head", "shoulder", "hips", "knee", "foot", "toe", "neck", "ankle", "heel", "chin")
HEIGHTS = (1.7, 1.4, 1.0, 0.5, 0.05, 0.02, 1.5, 0.1, 0.03, 1.6)


def person(origin=None, names=NAMES):
    """Stand with z up."""
    positions = RNG.normal(scale=1e-3, size=(30, 10, 3)) - [1.0, 1.0, 0.0]
    positions[..., 2] = HEIGHTS
    return Recording(np.arange(30) / 100, positions, names, 100.0, "a.x", origin=origin)


def lay(recording, up):
    """Return a recording as a file has it in whose frame another axis points up."""
    inverse = np.linalg.inv(np.stack([turn(one, up) for one in np.eye(3)], axis=1))
    return replace(recording, positions=recording.positions @ inverse.T)


@pytest.mark.parametrize("up", AXES)
def test_a_turn_is_a_rotation_that_brings_up_to_z(up):
    matrix = np.stack([turn(one, up) for one in np.eye(3)], axis=1)
    np.testing.assert_allclose(np.linalg.det(matrix), 1.0)
    vector = np.zeros(3)
    vector["xyz".index(up[-1])] = -1.0 if up[0] == "-" else 1.0
    np.testing.assert_array_equal(turn(vector, up), [0.0, 0.0, 1.0])
    # Orientations turn with it.
    quaternions = Rotation.random(30, rng=0).as_quat(scalar_first=True)[:, None]
    recording = Recording(
        np.arange(30) / 100, RNG.normal(size=(30, 1, 3)), ("a",), 100.0, "a.x", 1, quaternions
    )
    turned = turn_up(recording, up, PATH)
    expected = Rotation.from_matrix(matrix) * Rotation.from_quat(
        quaternions[:, 0], scalar_first=True
    )
    found = Rotation.from_quat(turned.orientations[:, 0], scalar_first=True)
    np.testing.assert_allclose((found * expected.inv()).magnitude(), 0.0, atol=1e-12)
    assert (turned.origin.up, turned.origin.up_by) == (up, "asked for")


@pytest.mark.parametrize("up", AXES)
def test_a_person_stands_afterwards(up):
    upright = person()
    laid = lay(upright, up)
    if up == "z":
        turned = turn_up(laid, None, PATH)
    else:
        with pytest.warns(RecordingWarning, match=rf"a.x: {up} points up, by names .*, not z"):
            turned = turn_up(laid, None, PATH)
    np.testing.assert_allclose(turned.positions, upright.positions, atol=1e-12)
    assert turned.origin.up == up


def test_what_the_format_or_the_file_says():
    laid = lay(person(), "y")
    # A format of one kind of frame is not looked at twice.
    fixed = turn_up(replace(laid, origin=Origin(up_by=BY_FORMAT)), None, PATH)
    np.testing.assert_array_equal(fixed.positions, laid.positions)
    agreed = turn_up(replace(laid, origin=Origin(up="y", up_by="the screen")), None, PATH)
    assert agreed.origin.up_by == "the screen and names of body parts and the floor"
    for said in ("the screen", BY_HABIT):
        wrong = replace(laid, origin=Origin(up="z", up_by=said))
        with pytest.warns(RecordingWarning, match=rf"not z \({said}\); --up z says otherwise"):
            assert turn_up(wrong, None, PATH).origin.up == "y"
    # The floor alone is less than the file's own word.
    unnamed = replace(laid, names=(None,) * 10, origin=Origin(up="z", up_by="the screen"))
    with pytest.warns(RecordingWarning, match=r"y seems to point up, by the floor, and z is taken"):
        assert turn_up(unnamed, None, PATH).origin.up == "z"


def test_where_nothing_tells_what_is_usual_is_taken():
    nothing = Recording(np.arange(30) / 100, RNG.normal(size=(30, 2, 3)), ("a", "b"), 100.0, "a.x")
    assert turn_up(nothing, None, PATH).origin == Origin()
    with pytest.warns(RecordingWarning, match="a.x: nothing tells which way is up; taken for y"):
        assert turn_up(replace(nothing, origin=Origin(up="y")), None, PATH).origin.up == "y"


def test_zeros_are_gaps():
    positions = np.ones((4, 2, 3))
    positions[1, 0] = positions[2, 0] = 0.0
    positions[3, 1] = [0.0, 0.0, 1e-9]
    recording = Recording(np.arange(4) / 10, positions, ("a", "b"), 10.0, "a.x")
    with pytest.warns(RecordingWarning, match=r"2 samples of 1 trajectory at exactly 0, 0, 0"):
        found = leave_out_zeros(recording)
    assert np.argwhere(np.isnan(found.positions[..., 0])).tolist() == [[1, 0], [2, 0]]
    assert found.origin.notes == ("2 samples at exactly 0, 0, 0 are gaps",)
    assert leave_out_zeros(replace(recording, positions=np.ones((4, 2, 3)))).origin is None


def test_names_of_options():
    assert (parse_up(None), parse_up("+Y"), parse_up("-z")) == (None, "y", "-z")
    assert (parse_units(None), parse_units(" MM ")) == (None, "mm")
    with pytest.raises(RecordingError, match=r"--up: got 'up'; expected x, y, z, -x, -y or -z"):
        parse_up("up")
    with pytest.raises(RecordingError, match=r"--units: got 'km'; expected m, cm, mm, in or ft"):
        parse_units("km")


@pytest.mark.parametrize("ending", [".tsv", ".c3d"])
def test_a_file_is_read_as_asked_for(tmp_path, ending):
    upright, path = person(), tmp_path / f"a{ending}"
    write_recording(lay(upright, "y"), path)
    with pytest.warns(RecordingWarning, match="y points up"):
        found = read_recording(path)
    np.testing.assert_allclose(found.positions, upright.positions, atol=1e-6)
    asked = read_recording(path, up="y")
    np.testing.assert_array_equal(asked.positions, found.positions)
    with reading(up="y"):
        np.testing.assert_array_equal(read_recording(path).positions, found.positions)
    with reading(up="z"), reading(partial=True):
        kept = read_recording(path)
    np.testing.assert_allclose(kept.positions, lay(upright, "y").positions, atol=1e-6)
    assert kept.origin.up_by == "asked for"
