"""Real files of other programs beside a plain reading of their cells."""

import csv

import numpy as np
import pytest
from places import REAL_DATA

from besman.io.recordings.conventions import turn
from besman.io.recordings.formats import read_recording

FORMATS = REAL_DATA / "formats"
pytestmark = [
    pytest.mark.skipif(not FORMATS.is_dir(), reason="the real files are not on this machine"),
    pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning"),
]


def cells(name, first, n_before):
    """Return the numbers of all rows whose first cell is one, NaN where there is none."""
    with (FORMATS / name).open(newline="") as file:
        rows = list(csv.reader(file))
    body = [row for row in rows[first:] if row and row[0].strip().isdigit()]
    width = max(map(len, body))
    return rows, np.array(
        [
            [float(cell) if cell.strip() else np.nan for cell in row[n_before:]]
            + [np.nan] * (width - len(row))
            for row in body
        ]
    )


def test_trc_of_commas():
    rows, values = cells("commas.trc", 6, 2)
    names = [name for name in rows[3][2:] if name]
    found = read_recording(FORMATS / "commas.trc")
    expected = values[:, : 3 * len(names)].reshape(len(values), -1, 3) / 1000
    assert found.names == tuple(names)
    np.testing.assert_allclose(found.positions, turn(expected, found.origin.up), atol=5e-7)
    assert (found.rate_hz, found.first_frame, found.time[0]) == (100.0, 1, 0.0)


def test_nexus_trajectories():
    rows, values = cells("nexus_trajectories.csv", 5, 2)
    names = [name for name in rows[2][2:] if name]
    found = read_recording(FORMATS / "nexus_trajectories.csv")
    expected = values[:, : 3 * len(names)].reshape(len(values), -1, 3) / 1000
    assert found.names == tuple(names)
    np.testing.assert_allclose(found.positions, turn(expected, found.origin.up), atol=5e-7)
    assert (found.rate_hz, found.first_frame) == (100.0, 1)


def test_nexus_model_outputs():
    rows, values = cells("nexus_model_outputs.csv", 5, 0)
    found = read_recording(FORMATS / "nexus_model_outputs.csv")
    assert (found.rate_hz, found.first_frame) == (120.0, 695)
    lengths = [k for k, unit in enumerate(rows[4]) if unit == "mm" and rows[3][k] in ("X", "TX")]
    assert len(lengths) == len(found.names)
    for index, column in enumerate(lengths):
        expected = turn(values[:, column : column + 3] / 1000, found.origin.up)
        np.testing.assert_allclose(found.positions[:, index], expected, atol=5e-7)


def test_motive():
    rows, values = cells("motive_1_23.csv", 7, 0)
    found = read_recording(FORMATS / "motive_1_23.csv")
    assert found.names[0] == "ernesto_body"
    assert (found.rate_hz, found.first_frame, found.origin.up) == (120.0, 0, "y")
    np.testing.assert_allclose(found.positions[:, 0], turn(values[:, 6:9], "y"), atol=5e-7)
    kinds, names = rows[2], rows[3]
    for index, name in enumerate(found.names[1:], start=1):
        (column, *_) = [k for k, one in enumerate(names) if one == name and kinds[k] == "Marker"]
        expected = turn(values[:, column : column + 3], "y")
        np.testing.assert_allclose(found.positions[:, index], expected, atol=5e-7)
