import inspect

import numpy as np
import pytest

from besman.exceptions import RecordingWarning
from besman.io.recordings.bodies import warn_of_no_turns
from besman.io.recordings.formats import read_recording
from besman.io.warning import warn_of_file


def test_a_warning_is_told_of_the_line_that_reads_however_deep_it_is_found(tmp_path):
    path = tmp_path / "a.trc"
    path.write_text(
        "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
        "100\t100\t5\t1\tm\nFrame#\tTime\ta\t\t\n\t\tX1\tY1\tZ1\n"
        "1\t0.00\t0\t1\t2\n2\t0.01\t0\t1\t2.1\n4\t0.03\t0\t1\t2.2\n"
    )
    here = inspect.currentframe().f_lineno + 2
    with pytest.warns(RecordingWarning) as found:
        read_recording(path)
    assert len(found) > 1
    with pytest.warns(RecordingWarning, match="1 orientations of 'b' are no rotations") as shallow:
        warn_of_no_turns(np.ones((1, 4)), np.full((1, 4), np.nan), "b", "a.tsv")
    told = [*found, *shallow]
    assert {one.filename for one in told} == {__file__}
    assert {one.lineno for one in found} == {here}


def test_a_warning_of_code_that_no_file_is_read_by_is_told_of_its_line():
    with pytest.warns(RecordingWarning, match="^said$") as found:
        warn_of_file("said")
    assert found[0].filename == __file__
