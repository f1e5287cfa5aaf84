# ruff: noqa: E501
"""What stands above a table of keypoints, as laboratories' programs write it."""

import numpy as np
import pytest

from besman.exceptions import RecordingError
from besman.io.recordings.format import reading
from besman.io.recordings.formats import read_recording
from besman.io.recordings.keypoint_columns import find_header

NAMES = ("nose", "RSHO", "RASI", "RANK")
PLACES = np.array([[0, 0, 1.7], [0, -0.2, 1.4], [0, -0.1, 0.9], [0, -0.1, 0.1]])
POSITIONS = np.round(PLACES + 0.05 * np.sin(np.arange(12) / 9)[:, None, None], 5)
XYZ = [f"{name}.{axis}" for name in NAMES for axis in "XYZ"]
pytestmark = pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")


def rows(mark, *before):
    return [
        mark.join([*(f"{one(at):g}" for one in before), *(f"{one:.5f}" for one in POSITIONS[at].flat)])
        for at in range(len(POSITIONS))
    ]  # fmt: skip


def count(at):
    return at + 1


def seconds(at):
    return at / 50


def thrice(names):
    return [name for name in names for _ in "xyz"]


FILES = {
    "BTS EMT": [
        "BTS ASCII format", "Type:           \tPoint 3D tracks", "Measure unit:   \tm", "",
        "Tracks:         \t4", "Frequency:      \t50 Hz", "Frames:         \t12", "Start time:     \t0.000",
        "", "\t".join(["Frame", "Time", *XYZ]), *rows("\t", count, seconds),
    ],
    "Visual3D": [
        "\t" + "\t".join(["C:\\gait\\walk.c3d"] * 12), "\t" + "\t".join(thrice(NAMES)),
        "\t" + "\t".join(["TARGET"] * 12), "\t" + "\t".join(["ORIGINAL"] * 12),
        "\t".join(["ITEM", *"XYZ" * 4]), *rows("\t", count),
    ],
    "keys with an equals sign": ["rate = 50", "units=m", ",".join(XYZ), *rows(",")],
    "a title": ["Walk of Ann", ",".join(["time [s]", *XYZ]), *rows(",", seconds)],
    "pandas with an index of times": [
        "," + ",".join(thrice(NAMES)), "," + ",".join("xyz" * 4), *rows(",", seconds),
    ],
    "Codamotion": ["\t".join(["Time(s)", *(one.replace(".", ".Pos") for one in XYZ)]), *rows("\t", seconds)],
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_what_stands_above_is_told_from_the_header(tmp_path, name):
    path = tmp_path / "a.txt"
    path.write_text("\n".join(FILES[name]) + "\n")
    with reading(rate_hz=50.0 if name == "Visual3D" else None):
        found = read_recording(path)
    assert found.names == NAMES
    assert found.rate_hz == 50.0
    np.testing.assert_allclose(found.positions, POSITIONS)
    assert found.origin.units == "m"


@pytest.mark.parametrize(
    "above",
    [
        ["Trajectories", "100"],
        ["NO_OF_FRAMES\t12"],
        ["a,b,c", "1,2,3"],
        ["Walk", "of Ann"],
    ],
)
def test_other_lines_above_are_no_header(tmp_path, above):
    assert find_header([*above, ",".join(XYZ), *rows(",")])[0] == 0


def test_an_odd_rate_above_is_said(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Frequency: fast", "Units: m", ",".join(XYZ), *rows(",")]))
    with pytest.raises(RecordingError, match="no number where the rate stands"):
        read_recording(path)
