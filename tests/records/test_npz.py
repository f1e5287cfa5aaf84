import io
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from besman.records.npz import ERRORS, Arrays

ANY = arrays.arrays(
    st.sampled_from([np.float64, np.int64, np.bool_, np.uint8, "<U3"]),
    arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
)


@given(ANY, st.booleans())
def test_arrays_are_those_that_numpy_wrote(array, turned):
    file = io.BytesIO()
    np.savez(file, one=array.T if turned else array)
    file.seek(0)
    with Arrays(file) as archive:
        np.testing.assert_array_equal(archive["one"], array.T if turned else array)
        assert archive["one"].dtype == array.dtype


def written(path, content):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("one.npy", content)
    return path


def header(shape, data=b"", version=(1, 0), descr="<f8"):
    file = io.BytesIO()
    fields = {"descr": descr, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, fields)
    content = file.getvalue()
    return content[:6] + bytes(version) + content[8:] + data


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (header((10**12,)), "array one: shape .* is larger than the file"),
        (header((-1, -1)), "array one: shape .* is larger than the file"),
        (header((2,), bytes(8)), "is not as long as its shape"),
        (header((1,), bytes(16)), "is not as long as its shape"),
        (header((1,), bytes(8), descr="|O"), "holds Python objects"),
        (header((1,), bytes(8), version=(9, 0)), "version .* is not known"),
    ],
)
def test_nothing_is_allocated_because_a_header_says_so(tmp_path, content, message):
    with (
        Arrays(written(tmp_path / "a.npz", content)) as archive,
        pytest.raises(ValueError, match=message),
    ):
        archive["one"]


def test_a_header_that_does_not_end_is_one_of_the_errors(tmp_path):
    content = header((2,), bytes(16)).replace(b"}", b" ")
    with Arrays(written(tmp_path / "a.npz", content)) as archive, pytest.raises(ERRORS):
        archive["one"]


def test_a_file_that_is_too_large_or_none_is_refused(tmp_path):
    path = written(tmp_path / "a.npz", header((1000,), bytes(8000)))
    with pytest.raises(ValueError, match=r"0 MB, expected at most 0\.001"):
        Arrays(path, 1000)
    path.write_bytes(b"none")
    with pytest.raises(ERRORS):
        Arrays(path)
