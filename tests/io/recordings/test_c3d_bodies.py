"""C3D that holds segments in place of points, as `c3d_segments` makes it."""

import struct

import ezc3d
import numpy as np
import pytest
from c3d_segments import BLOCK, N_BODIES, PLACES, TURNS, WALK, segments_file
from scipy.spatial.transform import Rotation

from besman.exceptions import RecordingError
from besman.io.recordings.formats import read_recording

CONCLUDING = pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")


@CONCLUDING
@pytest.mark.parametrize(("scale", "units"), [(1.0, "m"), (1000.0, "mm")])
@pytest.mark.parametrize(("ratio", "first"), [(1, 1), (1, 31), (2, 3)])
def test_segments_have_places_and_turns(tmp_path, scale, units, ratio, first):
    path = tmp_path / "a.c3d"
    path.write_bytes(segments_file(scale, ratio, first, unseen=[(4, 2)]))
    found = read_recording(path)
    places = np.array(WALK)
    places[4, 2] = np.nan
    assert found.names == tuple(PLACES)
    np.testing.assert_allclose(found.positions, places, atol=5e-7)
    turned = Rotation.from_quat(found.orientations.reshape(-1, 4), scalar_first=True).as_matrix()
    turned = turned.reshape(TURNS.shape)
    kept = np.isfinite(places).all(axis=-1)
    np.testing.assert_allclose(turned[kept], TURNS[kept], atol=1e-6)
    assert (found.origin.units, found.rate_hz) == (units, 60.0 * ratio)
    assert found.time[0] == pytest.approx((first - 1) / 60.0)


@CONCLUDING
def test_ezc3d_reads_the_same(tmp_path):
    path = tmp_path / "a.c3d"
    path.write_bytes(segments_file())
    other = ezc3d.c3d(str(path))["data"]["rotations"].transpose(3, 2, 0, 1)
    np.testing.assert_allclose(read_recording(path).positions, other[..., :3, 3], atol=1e-9)
    np.testing.assert_allclose(other[..., :3, :3], TURNS, atol=1e-6)


@CONCLUDING
def test_what_is_cut_is_one_line(tmp_path):
    path = tmp_path / "a.c3d"
    path.write_bytes(segments_file()[: 3 * BLOCK + 5 * 17 * 4 * N_BODIES + 7])
    with pytest.raises(RecordingError, match="the file ends after 5 of 12 frames; is it cut"):
        read_recording(path)
    assert len(read_recording(path, partial=True).time) == 5
    content = segments_file().replace(b"DATA_START", b"DATA_STARX")
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="of 12 frames; is it cut"):
        read_recording(path)
    content = bytearray(segments_file())
    struct.pack_into("<2H", content, 6, 9, 4)
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="frames 9 to 4; expected frames that count up"):
        read_recording(path)
