from pathlib import Path

import pytest

from besman.exceptions import RecordingError
from besman.io.recordings.formats import read_recording
from besman.io.recordings.table_end import find_end

TRC = (
    "PathFileType\t4\t(X/Y/Z)\ta.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\t"
    "OrigNumFrames\n100\t100\t4\t1\tm\t100\t1\t4\n"
    "Frame#\tTime\tHand\t\t\n\t\tX1\tY1\tZ1\n\n"
)
ROWS = [f"{k}\t{k / 100:.2f}\t0.{k}\t1.1\t1.2\n" for k in range(1, 5)]


def test_rows_below_an_empty_line_are_not_left_out_in_silence(tmp_path):
    path = tmp_path / "a.trc"
    path.write_text(TRC + "".join(ROWS) + "\n\n")
    assert len(read_recording(path).time) == 4
    path.write_text(TRC + "".join([*ROWS[:2], "\n", "\t\t\t\t\n", *ROWS[2:]]))
    with pytest.raises(RecordingError, match=r":9: an empty line among the rows, which go on in "):
        read_recording(path)


@pytest.mark.parametrize("below", [[], ["", ""], ["Model Outputs"], ["Devices,,,"], ["7"]])
def test_another_table_or_nothing_ends_it(below):
    lines = ["6,1", "7,2", "", *below]
    body = [line.replace(",", "\t").encode() for line in lines[1:]]
    assert find_end(body, lines, 1, lambda line: line.split(","), Path("a.csv")) == 1
    assert find_end(body[:1], lines, 1, lambda line: line.split(","), Path("a.csv")) == 1
