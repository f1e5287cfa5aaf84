"""Tables with a row a keypoint give what the same table with a row a frame gives."""

import numpy as np
import pandas
import pytest
from foreign_recordings import write_keypoint_rows, write_keypoint_table

from besman.exceptions import RecordingError
from besman.io.recordings.formats import read_recording
from besman.io.recordings.keypoint_rows import find_row_columns
from besman.records import Recording

NAMES = ("head", "hips", "foot")


def take(n=12, gap=True):
    time = np.arange(n) / 50
    positions = np.array([[0.0, 0.0, 1.7], [0.1, 0.2, 0.9], [0.3, 0.1, 0.1]]) + np.zeros((n, 1, 1))
    positions = positions + 0.05 * np.sin(3 * time)[:, None, None]
    if gap:
        positions[4:6, 1] = np.nan
    return Recording(time, positions, NAMES, 50.0, "a", 1)


def read(path, text=None):
    if text is not None:
        path.write_text(text)
    return read_recording(path, units="m")


def test_rows_are_what_columns_are(tmp_path):
    write_keypoint_table(take(), tmp_path / "wide.csv")
    write_keypoint_rows(take(), tmp_path / "long.csv")
    wide, long = read(tmp_path / "wide.csv"), read(tmp_path / "long.csv")
    assert long.names == wide.names
    assert (long.rate_hz, long.first_frame) == (wide.rate_hz, wide.first_frame)
    np.testing.assert_allclose(long.positions, wide.positions, atol=1e-6)
    np.testing.assert_allclose(long.time, wide.time, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_rows_in_any_order_are_what_pandas_pivots(tmp_path, seed):
    rng = np.random.default_rng(seed)
    write_keypoint_rows(take(), tmp_path / "a.csv")
    table = pandas.read_csv(tmp_path / "a.csv")
    table = table.iloc[rng.permutation(len(table))]
    # Some rows are missing, but no frame is.
    table = table.drop(index=table.index[table.marker != "head"][:5])
    table.insert(2, "note", "seen well")
    table.to_csv(tmp_path / "b.csv", index=False)
    found = read(tmp_path / "b.csv")
    pivoted = table.pivot_table(
        index="time", columns="marker", values=["x", "y", "z"], dropna=False
    )
    for column, name in enumerate(found.names):
        expected = np.column_stack([pivoted[axis, name] for axis in "xyz"])
        np.testing.assert_allclose(found.positions[:, column], expected, atol=1e-6)


def test_units_people_and_frames_alone(tmp_path):
    rows = [
        f"{frame};{person};{name};{1000 * z:.1f};0.0;{100 * frame}.5"
        for frame in range(3, 7)
        for person in ("ann", "bob")
        for name, z in (("nose", 1.6), ("foot", 0.1))
    ]
    text = "\n".join(["# fps: 25", "frame;person;keypoint;z_mm;y_mm;x_mm", *rows]) + "\n"
    path = tmp_path / "a.csv"
    path.write_text(text)
    found = read_recording(path, up="z")
    assert found.names == ("ann:nose", "ann:foot", "bob:nose", "bob:foot")
    assert (found.rate_hz, found.first_frame, found.origin.units) == (25.0, 3, "mm")
    np.testing.assert_allclose(found.positions[0, 0], [0.3005, 0.0, 1.6])
    alone = [line for line in text.split("\n") if ";bob;" not in line]
    path.write_text("\n".join(alone))
    assert read_recording(path, up="z").names == ("nose", "foot")


HEAD = "time,marker,x,y,z\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD + "0,a,1,2,3\n0,b,1,2,3\n0.1,a,1,2,3\n0.1,a,1,2,3\n", r":5: 'a' is there twice in"),
        (HEAD + "0,a,1,2,3\n,b,1,2,3\n0.1,a,1,2,3\n", r":3: got nothing in column 'time'"),
        (HEAD + "0,a,1,2,3\n0,,1,2,3\n0.1,a,1,2,3\n", r":3: got no name of a keypoint"),
        (HEAD + "0,a,1,2,3\n0,b,1,two,3\n", r":3: column 4: got 'two'"),
        ("marker,x,y,z\na,1,2,3\na,1,2,3\n", "no column that tells the frame"),
        (
            HEAD + "".join(f"{k / 100},m{k},1,2,3\n" for k in range(400)),
            "400 rows of 400 keypoints in 400 frames; expected a row of most",
        ),
    ],
)
def test_what_cannot_be_a_table_of_rows_is_one_line(tmp_path, text, message):
    with pytest.raises(RecordingError, match=message):
        read(tmp_path / "a.csv", text)


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        ("frame keypoint x y z", (1, (2, 3, 4), None, "")),
        ("z_cm y_cm x_cm person_id name t", (4, (2, 1, 0), 3, "cm")),
        ("time Landmark pos_x pos_y pos_z", (1, (2, 3, 4), None, "")),
        ("time nose_x nose_y nose_z", None),
        ("time marker x y", None),
        ("recording x_m y_m z_m", None),
    ],
)
def test_columns_of_rows_are_told_from_others(labels, expected):
    assert find_row_columns(labels.split()) == expected
