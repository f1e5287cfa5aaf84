"""What is recorded of a stream can be read at any time, also where the disk is full."""

import errno
import os

import numpy as np
import pytest

from besman.exceptions import FileError
from besman.io.recordings.formats import read_recording
from besman.live.capture import CaptureFile, WholeLines

NAMES = ("hand", "elbow")


@pytest.fixture
def frames():
    steps = np.random.default_rng(2).normal(0, 0.005, size=(25, 2, 3))
    found = np.array([[0.0, 0.0, 1.0], [0.3, 0.0, 1.0]]) + np.cumsum(steps, axis=0)
    found[7, 1] = np.nan
    return found


def test_it_is_whole_before_it_is_closed_and_after(tmp_path, frames):
    capture = CaptureFile(tmp_path / "a.tsv", NAMES, 10.0)
    for k, frame in enumerate(frames):
        capture.add(frame)
        if k in (9, 19):
            # As who looks at it now, or after a kill, sees it.
            found = read_recording(tmp_path / "a.tsv")
            np.testing.assert_allclose(found.positions, frames[: k + 1], atol=6e-7)
            assert (found.names, found.rate_hz) == (NAMES, 10.0)
    capture.close()
    found = read_recording(tmp_path / "a.tsv")
    np.testing.assert_allclose(found.positions, frames, atol=6e-7)
    assert "NO_OF_FRAMES\t0000000025\n" in (tmp_path / "a.tsv").read_text()


def test_a_full_disk_leaves_what_was_whole(tmp_path, frames, monkeypatch):
    capture = CaptureFile(tmp_path / "a.tsv", NAMES, 10.0)
    for frame in frames[:10]:
        capture.add(frame)
    left, write = [50], os.pwrite

    def write_until_full(file, data, at):
        if left[0] <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        n = write(file, data[: left[0]], at)
        left[0] -= n
        return n

    monkeypatch.setattr(os, "pwrite", write_until_full)
    for frame in frames[10:19]:
        capture.add(frame)
    with pytest.raises(FileError, match=r"a\.tsv: cannot be written: No space left on device; "):
        capture.add(frames[19])
    monkeypatch.undo()
    np.testing.assert_allclose(read_recording(tmp_path / "a.tsv").positions, frames[:10], atol=6e-7)


def test_nothing_is_written_over(tmp_path):
    (tmp_path / "a.tsv").write_text("mine")
    with pytest.raises(FileError, match="is there already; expected a new name"):
        CaptureFile(tmp_path / "a.tsv", NAMES, 10.0)
    with pytest.raises(FileError, match=r"b\.csv: expected a name that ends in \.tsv"):
        CaptureFile(tmp_path / "b.csv", NAMES, 10.0)
    with pytest.raises(FileError, match="cannot be written: No such file or directory"):
        WholeLines(tmp_path / "none" / "c.jsonl")
    assert (tmp_path / "a.tsv").read_text() == "mine"
