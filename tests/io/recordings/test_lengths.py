# ruff: noqa: E501
import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.exceptions import RecordingWarning
from besman.io.recordings.bodies import from_matrices, hold_orientations
from besman.io.recordings.c3d_names import find_names, keep_single_names
from besman.io.recordings.lengths import (
    UNIT_M,
    body_length,
    find_length,
    in_metres,
    parse_unit,
    typical_extent,
)


@pytest.mark.parametrize(
    ("word", "name"),
    [("mm", "mm"), ("Millimeters", "mm"), ("mill", "mm"), ("mete", "m"), ("Metres", "m"), ("(m)", "m"),
     ("CM", "cm"), ("centimeter", "cm"), ("inches", "in"), ("feet", "ft"), ("deg", None), ("N", None),
     ("N.mm", None), ("", None), ("metric", None)],
)  # fmt: skip
def test_words_for_units(word, name):
    assert parse_unit(word) == name
    assert name is None or name in UNIT_M


def test_the_extent_of_what_is_seen():
    positions = np.array([[[0.0, 0, 0], [3, 4, 0], [np.nan, np.nan, np.nan]]])
    assert typical_extent(positions) == 5.0
    assert typical_extent(np.full((2, 2, 3), np.nan)) == 0.0


def test_a_unit_that_makes_nobody_of_a_person_is_doubted():
    person = np.random.default_rng(0).uniform(0.0, 1.7, (50, 6, 3))
    with pytest.warns(
        RecordingWarning, match=r"units is 'mm', so points .* 0\.00\d+ m apart; in m "
    ):
        found = find_length("mm", None, person, "a/b.json", "units")
    assert (found.name, found.told_by) == ("mm", "the file")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        find_length("m", None, person, "b.json", "units")
        find_length("mm", None, 1000.0 * person, "b.json", "units")
        # A plate with three markers is as small as it is.
        find_length("mm", None, person[:, :3], "b.json", "units")


def test_orientations_over_gaps_and_of_matrices():
    turns = Rotation.random(5, rng=0)
    found = from_matrices(np.concatenate([turns.as_matrix(), np.full((1, 3, 3), np.nan)]))
    np.testing.assert_allclose(found[:5], turns.as_quat(canonical=True, scalar_first=True))
    assert np.isnan(found[5]).all()
    gaps = np.full((4, 2, 4), np.nan)
    gaps[1:3, 0] = found[:2]
    held = hold_orientations(gaps)
    np.testing.assert_array_equal(held[:, 0], found[[0, 0, 1, 1]])
    assert np.isnan(held[:, 1]).all()


def test_names_of_prefixes_and_twins():
    positions = np.ones((2, 3, 3))
    assert find_names(["s:a", "s:b", "s:*1"], [""] * 3, positions, "x") == ("a", "b", None)
    positions[:, 2] = np.nan
    assert keep_single_names(["a", "b", "a"], positions, "x", "points") == ("a", "b", None)


def test_a_frame_in_which_nothing_is_seen_tells_no_height():
    positions = np.array([[[0.0, 0, 1.7], [0, 0, 0.1]]] * 4)
    positions[2] = np.nan
    with pytest.warns(
        RecordingWarning, match="the body is 1.6 high, so they are taken for m"
    ) as said:
        assert body_length(positions, None, "a/b.csv").name == "m"
    assert [one.category for one in said] == [RecordingWarning]


def test_what_is_no_number_is_nan_in_metres_without_a_warning():
    signalling = np.frombuffer(b"\1\0\0\0\0\0\xf0\x7f" + np.float64(20.0).tobytes())
    with np.errstate(all="raise"):
        found = in_metres(signalling, 0.01)
    assert np.isnan(found[0])
    assert found[1] == 0.2
    single = np.frombuffer(b"\1\0\x80\x7f" + np.float32(0.1).tobytes(), np.float32)
    with np.errstate(all="raise"):
        found = in_metres(single, 0.001)
    assert np.isnan(found[0])
    assert found[1] == np.float64(np.float32(0.1)) * 0.001
