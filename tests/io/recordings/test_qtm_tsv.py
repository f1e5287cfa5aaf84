import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from besman.exceptions import RecordingError
from besman.io.recordings.qtm_tsv import read_tsv, write_tsv
from besman.records import Recording

REAL = Path(
    os.environ.get("BESMAN_REAL_DATA", Path(__file__).parents[3].parent / "shared" / "data")
)

HEADER = """NO_OF_FRAMES\t99
NO_OF_CAMERAS\t7
NO_OF_MARKERS\t2
FREQUENCY\t60
NO_OF_ANALOG\t0
ANALOG_FREQUENCY\t0
DESCRIPTION\t--
TIME_STAMP\t2015-11-12, 11:51:16\t6281.31358754
DATA_INCLUDED\t3D
MARKER_NAMES\tHand top\tElbow
"""
COLUMNS = "Frame\tTime\tHand top X\tHand top Y\tHand top Z\tElbow X\tElbow Y\tElbow Z\t\n"
ROWS = (
    "690\t11.48333\t1.000\t2.000\t3.000\t4.000\t5.000\t6.000\n"
    "691\t11.50000\t1.500\t2.500\t3.500\t4.500\t5.500\t6.500\n"
    "692\t11.51667\t2.000\t3.000\t4.000\t5.000\t6.000\t7.000\n"
)
EXPECTED = np.array(
    [
        [[1.0, 2, 3], [4, 5, 6]],
        [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]],
        [[2, 3, 4], [5, 6, 7]],
    ]
)


def write(folder: Path, text: str) -> Path:
    path = folder / "run.tsv"
    path.write_text(text, newline="")
    return path


def test_positions_in_metres_and_absolute_frames(tmp_path):
    recording = read_tsv(write(tmp_path, HEADER + COLUMNS + ROWS))
    np.testing.assert_allclose(recording.positions, EXPECTED / 1000)
    assert recording.names == ("Hand top", "Elbow")
    assert recording.first_frame == 690
    assert recording.rate_hz == 60
    assert recording.source == "run.tsv"
    np.testing.assert_allclose(recording.time, np.array([689, 690, 691]) / 60)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: "\ufeff" + text,
        lambda text: text + "\n\n",
        lambda text: text.rstrip("\n"),
        lambda text: text.replace("000\n", "000\t\n").replace("500\n", "500\t\n"),
        lambda text: text.replace("6.000\n", "6.000\t\n"),
        lambda text: "FILE_VERSION\t2.0.0\n" + text,
        lambda text: text.replace("Frame\t", "TRAJECTORY_TYPES\tMeasured\tMixed\nFrame\t"),
        lambda text: text.replace("DATA_", "EVENT\tstart\t10\t0.16\nEVENT\tend\t20\t0.3\nDATA_"),
        lambda text: text.replace("FREQUENCY\t60", "FREQUENCY\tEXT"),
        lambda text: text.replace(COLUMNS, ""),
        lambda text: text.replace("DESCRIPTION\t--", "DESCRIPTION\tArm hängt"),
    ],
)
def test_layouts_that_mean_the_same(tmp_path, change):
    recording = read_tsv(write(tmp_path, change(HEADER + COLUMNS + ROWS)))
    np.testing.assert_allclose(recording.positions, EXPECTED / 1000)
    assert recording.first_frame == 690
    assert recording.rate_hz == pytest.approx(60, abs=0.02)


def test_old_code_page(tmp_path):
    path = tmp_path / "run.tsv"
    path.write_bytes((HEADER.replace("--", "Größe") + COLUMNS + ROWS).encode("latin-1"))
    assert len(read_tsv(path).time) == 3


@pytest.mark.parametrize(
    "columns", ["Hand top X\tHand top Y\tHand top Z\tElbow X\tElbow Y\tElbow Z\n", ""]
)
def test_without_frame_and_time(tmp_path, columns):
    rows = "\n".join("\t".join(row.split("\t")[2:]) for row in ROWS.splitlines())
    recording = read_tsv(write(tmp_path, HEADER + columns + rows))
    np.testing.assert_allclose(recording.positions, EXPECTED / 1000)
    assert recording.first_frame == 1


@pytest.mark.parametrize("end", ["\n", "\t\n"])
@pytest.mark.parametrize("gap", ["nan", "NaN", "null", "NULL", "", " "])
@pytest.mark.parametrize("marker", [0, 1])
@pytest.mark.parametrize("row", [0, 2])
def test_gaps(tmp_path, gap, marker, row, end):
    cells = [line.split("\t") for line in ROWS.splitlines()]
    cells[row][2 + 3 * marker : 5 + 3 * marker] = [gap] * 3
    body = "".join("\t".join(line) + end for line in cells)
    expected = EXPECTED.copy()
    expected[row, marker] = np.nan
    recording = read_tsv(write(tmp_path, HEADER + COLUMNS + body))
    np.testing.assert_allclose(recording.positions, expected / 1000)


def test_unnamed_trajectory(tmp_path):
    text = (HEADER + COLUMNS + ROWS).replace("top\tElbow\n", "top\t\n")
    recording = read_tsv(
        write(
            tmp_path, text.replace("Elbow X", "X").replace("Elbow Y", "Y").replace("Elbow Z", "Z")
        )
    )
    assert recording.names == ("Hand top", None)


@pytest.mark.parametrize("name", ["*", "*12", "New 0001", "Unidentified 3", "unlabeled_2", ""])
def test_unidentified_trajectories(tmp_path, name):
    text = (HEADER + COLUMNS + ROWS).replace("Elbow", name).replace("Hand top", name)
    text = text.replace("\t X", "\tX").replace("\t Y", "\tY").replace("\t Z", "\tZ")
    assert read_tsv(write(tmp_path, text)).names == (None, None)
    rows = "\n".join("\t".join(row.split("\t")[2:]) for row in ROWS.splitlines())
    without = text[: text.index("Frame\t")] + text[text.index("Time\t") + 5 :]
    without = without[: without.index("690\t")] + rows
    assert read_tsv(write(tmp_path, without)).names == (None, None)


def test_new_export_with_everything(tmp_path):
    text = (
        "FILE_VERSION\t2.0.0\n"
        + HEADER.replace("FREQUENCY\t60", "FREQUENCY\tEXT").replace(
            "DATA_INCLUDED", "EVENT\tgo\t691\t11.5\nEVENT\tend\t692\t11.51667\nDATA_INCLUDED"
        )
        + "TRAJECTORY_TYPES\tMeasured\tMixed\n"
        + COLUMNS
        + ROWS.replace("5.000", "").replace("4.000\t", "\t", 1)
    )
    text = text.replace("\tHand top\tElbow\n", "\tHand top\t\n").replace("Elbow X", "X")
    text = text.replace("Elbow Y", "Y").replace("Elbow Z", "Z")
    recording = read_tsv(write(tmp_path, text))
    assert recording.names == ("Hand top", None)
    assert recording.rate_hz == pytest.approx(60, abs=0.02)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda text: text.replace("11.50000", "nan"),
            r"run.tsv:13: time is nan s after 11.4833 s; expected rising times",
        ),
        (lambda text: text.replace("11.48333", "nan"), r"run.tsv:12: time is nan s; expected"),
        (lambda text: text.replace("11.51667", "11.4"), r"run.tsv:14: time is 11.4 s after 11.5 s"),
        (
            lambda text: text.replace("CY\t60", "CY\t100"),
            r"FREQUENCY is 100 but the Time column counts 59.99 frames a second",
        ),
        (lambda text: "", r"run.tsv: the file is empty"),
        (lambda text: " \n\n", r"run.tsv: the file is empty"),
        (lambda text: HEADER + COLUMNS, r"run.tsv:11: no frames after the header; is the file cut"),
        (lambda text: HEADER, r"run.tsv:10: no frames after the header"),
        (lambda text: text[: text.rindex("\t5.000")], r"run.tsv:14: got 5 columns, expected 8; is"),
        (lambda text: text.replace("3.500", "3.5x"), r"run.tsv:13: column 5: got '3.5x', exp"),
        (lambda text: text.replace("3.500", "inf"), r"run.tsv:13: column 5: got 'inf'"),
        (lambda text: text.replace("MARKER_NAMES", "NAMES"), r"run.tsv: no line MARKER_NAMES"),
        (lambda text: "1\t2\t3\n", r"run.tsv: no line MARKER_NAMES before line 1"),
        (lambda text: text.replace("top\tElbow\n", "top\n"), r"run.tsv:11: the columns do not fit"),
        (
            lambda text: text.replace("\tHand top\tElbow\n", "\n").replace(
                "MARKERS\t2", "MARKERS\t0"
            ),
            r"run.tsv:10: MARKER_NAMES is empty",
        ),
        (lambda text: text.replace("MARKERS\t2", "MARKERS\t1"), r"has 2 names, expected NO_OF"),
        (lambda text: text.replace("Elbow", "Hand top"), r"2 markers are named 'Hand top'"),
        (lambda text: text.replace("Elbow Z", "Wrist Z"), r"run.tsv:11: the columns do not fit"),
        (
            lambda text: text.replace(COLUMNS, "").replace("690\t", ""),
            r"run.tsv:11: got 7 columns, "
            r"expected 6 for 2 markers, or 8 with frame and time",
        ),
        (lambda text: text.replace("692\t", "680\t"), r"run.tsv:14: frame 680 follows frame 691"),
        (lambda text: text.replace("692\t", "695\t"), r"run.tsv:14: frame 695 follows frame 691"),
        (lambda text: text.replace("692\t", "nan\t"), r"run.tsv:14: frame is nan; expected a"),
        (lambda text: text.replace("692\t", "691.5\t"), r"run.tsv:14: frame is 691.5"),
        (lambda text: text.replace("CY\t60", "CY\tfast"), r"FREQUENCY is 'fast'; expected"),
        (lambda text: text.replace("CY\t60", "CY\t0"), r"FREQUENCY is '0'; expected"),
        (
            lambda text: text.replace("CY\t60", "CY\tEXT").replace("11.51667", "11.40"),
            r"run.tsv:14: time is 11.4 s after 11.5 s; expected rising times",
        ),
    ],
)
def test_bad_files(tmp_path, change, message):
    path = write(tmp_path, change(HEADER + COLUMNS + ROWS))
    with pytest.raises(RecordingError, match=message) as caught:
        read_tsv(path)
    assert "\n" not in str(caught.value)


def test_unknown_rate(tmp_path):
    rows = "\n".join("\t".join(row.split("\t")[2:]) for row in ROWS.splitlines())
    text = (HEADER + rows).replace("FREQUENCY\t60", "FREQUENCY\tEXT")
    with pytest.raises(RecordingError, match="FREQUENCY is not a number and there is no Time"):
        read_tsv(write(tmp_path, text))


def test_missing_file(tmp_path):
    with pytest.raises(RecordingError, match=r"absent.tsv: no such file"):
        read_tsv(tmp_path / "absent.tsv")
    with pytest.raises(RecordingError, match="cannot be read"):
        read_tsv(tmp_path)


@settings(max_examples=30, deadline=None)
@given(
    positions=npst.arrays(
        np.float64,
        st.tuples(st.integers(1, 12), st.integers(1, 4), st.just(3)),
        elements=st.one_of(st.floats(-9, 9, width=32), st.just(np.nan)),
    ),
    first_frame=st.integers(1, 5000),
    rate_hz=st.sampled_from([60.0, 100.0, 500.0]),
)
def test_round_trip(tmp_path_factory, positions, first_frame, rate_hz):
    recording = Recording(
        time=(first_frame - 1 + np.arange(len(positions))) / rate_hz,
        positions=positions,
        names=("Hand top", "elbow", "Ü", "4")[: positions.shape[1]],
        rate_hz=rate_hz,
        source="trip.tsv",
        first_frame=first_frame,
    )
    path = tmp_path_factory.mktemp("trip") / "trip.tsv"
    write_tsv(recording, path)
    again = read_tsv(path)
    np.testing.assert_allclose(again.positions, positions, atol=0.6e-6, rtol=0)
    np.testing.assert_array_equal(again.time, recording.time)
    assert (again.names, again.rate_hz, again.source, again.first_frame) == (
        recording.names,
        rate_hz,
        "trip.tsv",
        first_frame,
    )


def test_large_file_is_written_in_blocks(tmp_path):
    positions = np.random.default_rng(0).normal(size=(9001, 2, 3))
    recording = Recording(np.arange(9001) / 100, positions, ("a", "b"), 100.0, "big.tsv")
    write_tsv(recording, tmp_path / "big.tsv")
    np.testing.assert_allclose(
        read_tsv(tmp_path / "big.tsv").positions, positions, atol=0.6e-6, rtol=0
    )


@pytest.mark.skipif(not REAL.is_dir(), reason="the real recordings are not on this machine")
def test_real_recordings():
    paths = sorted((REAL / "pick_and_place").glob("*.tsv"))
    assert len(paths) == 12
    for path in paths:
        recording = read_tsv(path)
        assert recording.rate_hz == 60
        assert recording.positions.shape[1] == 13
        lines = path.read_text().splitlines()
        cells = lines[60].split("\t")
        row = int(cells[0]) - recording.first_frame
        column = lines[10].split("\t").index("Hand top X")
        np.testing.assert_allclose(
            recording.positions[row, recording.names.index("Hand top")],
            [float(cell) / 1000 for cell in cells[column : column + 3]],
        )
        assert abs(recording.time[row] - float(cells[1])) < 1e-5


def test_decimal_commas_and_blanks_behind_keys(tmp_path):
    lines = HEADER.replace("DESCRIPTION\t--", "DESCRIPTION -- ").replace("\t60", "\t60,0 ")
    found = read_tsv(write(tmp_path, lines + COLUMNS + ROWS.replace(".", ",")))
    np.testing.assert_allclose(found.positions, EXPECTED / 1000)
    assert found.rate_hz == 60
    with pytest.raises(RecordingError, match="ends before those above it do; is the file cut"):
        read_tsv(write(tmp_path, HEADER + COLUMNS + ROWS[:-3].replace(".", ",")))
