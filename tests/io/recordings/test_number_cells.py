import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.exceptions import RecordingError
from besman.io.recordings import text_lines
from besman.io.recordings.number_cells import parse_cells
from besman.io.recordings.qtm_tsv import read_tsv, write_tsv
from besman.records import Recording

CELLS = st.one_of(
    st.decimals(-99_999, 99_999, places=3).map(str),
    st.decimals(-1, 1, places=12).map("{:f}".format),
    st.integers(-(10**9), 10**9).map(str),
    st.sampled_from(
        ["", " ", "nan", "NaN", "null", "NULL", " 1.5 ", "+2.", ".25", "-0.0", "-.5", "-1.5E-3"]
    ),
)


def as_float(cell):
    stripped = cell.strip().lower()
    return float("nan") if stripped in ("", "null") else float(stripped)


@settings(deadline=None)
@given(st.lists(st.lists(CELLS, min_size=2, max_size=4), min_size=1, max_size=20))
def test_values_are_those_of_python_to_the_last_bit(rows):
    text = "\n".join("\t".join(row) for row in rows)
    expected = np.array([as_float(cell) for row in rows for cell in row])
    found = parse_cells(text.encode(), expected.size)
    if " " in text:
        assert found is None
    else:
        assert found.tobytes() == np.where(np.isnan(expected), np.nan, expected).tobytes()


@pytest.mark.parametrize("beside", ["1", "", "nan"])
@pytest.mark.parametrize(
    "cell",
    ["x", "inf", "1e400", "nanx", "nul", "na", "n", "1.2.3", "1 2", "--1", "-", "+", "1-2", ".",
     "1,5", "²", "1_0", "0x1", "nan(1)", "5null", "nullnull", "e5", "1e", "1\r2", "\x0b"],
)  # fmt: skip
def test_what_is_no_plain_number_is_left_to_python(cell, beside):
    assert parse_cells(f"1\t{cell}\t{beside}".encode(), 3) is None
    assert parse_cells(f"{beside}\t{cell}\t1".encode(), 3) is None


def test_long_recordings_are_read_by_parts(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    positions = rng.normal(size=(500, 4, 3))
    positions[100:140, 1] = np.nan
    path = tmp_path / "a.tsv"
    write_tsv(Recording(np.arange(500) / 100, positions, tuple("abcd"), 100.0, path.name), path)
    whole = read_tsv(path)
    np.testing.assert_allclose(whole.positions, positions, rtol=0, atol=6e-7)
    monkeypatch.setattr(text_lines, "_AT_ONCE", 1000)
    parts = read_tsv(path)
    assert parts.positions.tobytes() == whole.positions.tobytes()
    assert parts.time.tobytes() == whole.time.tobytes()
    lines = path.read_text().splitlines()
    # Some lines end with a tab, some cells are padded, empty or spelt in another way.
    lines[200:300] = [line + "\t" for line in lines[200:300]]
    lines[310] = lines[310].replace("\t", "\t  ")
    lines[320:420] = [line.replace("nan", ("null", "", "NULL", " NaN")[k % 4]) for k, line in
                      enumerate(lines[320:420])]  # fmt: skip
    path.write_text("\r\n".join(lines) + "\r\n")
    assert read_tsv(path).positions.tobytes() == whole.positions.tobytes()
    with monkeypatch.context() as patch:
        patch.setattr(text_lines.TextLines, "__len__", lambda lines: lines._n_lines - 1)
        with pytest.raises(RecordingError, match="changed while it was read"):
            read_tsv(path)
    lines[300] = lines[300].replace("\t", "\tx", 4)
    path.write_text("\n".join(lines))
    with pytest.raises(RecordingError, match=r"a\.tsv:301: column 2: got 'x"):
        read_tsv(path)
    lines[400] += "\t1"
    path.write_text("\n".join(lines))
    with pytest.raises(RecordingError, match=r"a\.tsv:401: got 15 columns, expected 14"):
        read_tsv(path)
