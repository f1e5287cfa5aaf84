import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.exceptions import RecordingError
from besman.io.recordings import qtm_tsv
from besman.io.recordings.number_kernel import parse_numbers
from besman.io.recordings.qtm_tsv import read_tsv, write_tsv
from besman.records import Recording

CELLS = st.one_of(
    st.decimals(-99_999, 99_999, places=3).map(str),
    st.decimals(-1, 1, places=12).map("{:f}".format),
    st.integers(-(10**9), 10**9).map(str),
    st.sampled_from(["", " ", "nan", "NaN", "null", "NULL", " 1.5 ", "+2.", ".25", "-0.0", "-.5"]),
)


def as_float(cell):
    stripped = cell.strip().lower()
    return float("nan") if stripped in ("", "null") else float(stripped)


@settings(deadline=None)
@given(st.lists(st.lists(CELLS, min_size=3, max_size=3), min_size=1, max_size=20))
def test_values_are_those_of_python_to_the_last_bit(rows):
    text = "\n".join("\t".join(row) for row in rows)
    expected = np.array([as_float(cell) for row in rows for cell in row])
    found = parse_numbers(text, expected.size)
    assert found.tobytes() == np.where(np.isnan(expected), np.nan, expected).tobytes()


@pytest.mark.parametrize(
    "cell",
    [
        "x",
        "1e5",
        "inf",
        "nanx",
        "nul",
        "na",
        "n",
        "1.2.3",
        "1 2",
        "--1",
        "-",
        "+",
        "+nan",
        ".",
        "1,5",
        "²",
        "9007199254740993",
        "0." + "0" * 23 + "1",
    ],
)
def test_what_is_no_plain_number_is_left_to_python(cell):
    assert parse_numbers(f"1\t{cell}\t2", 3) is None


def test_more_or_fewer_cells_are_left_to_python():
    assert parse_numbers("1\t2", 3) is None
    assert parse_numbers("1\t2\t3", 2) is None


def test_long_recordings_are_read_as_short_ones(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    positions = rng.normal(size=(500, 4, 3))
    positions[100:140, 1] = np.nan
    path = tmp_path / "a.tsv"
    write_tsv(Recording(np.arange(500) / 100, positions, tuple("abcd"), 100.0, path.name), path)
    plain = read_tsv(path)
    monkeypatch.setattr(qtm_tsv, "_LONG_TEXT", 0)
    fast = read_tsv(path)
    assert fast.positions.tobytes() == plain.positions.tobytes()
    assert fast.time.tobytes() == plain.time.tobytes()
    text = path.read_text().splitlines()
    text[300] = text[300].replace("\t", "\tx", 4)
    path.write_text("\n".join(text))
    with pytest.raises(RecordingError, match="column 2: got 'x"):
        read_tsv(path)
