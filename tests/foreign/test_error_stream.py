import os
import sys

import pytest

from besman.foreign.error_stream import catch_error_stream


def test_what_a_library_writes_is_caught_and_nothing_else(capfd):
    print("before", file=sys.stderr)
    with catch_error_stream() as lines:
        os.write(2, b"one\ntwo \xff\n")
    print("after", file=sys.stderr)
    assert lines == ["one", "two \ufffd"]
    assert capfd.readouterr().err == "before\nafter\n"


def _fail(caught):
    with catch_error_stream() as lines:
        caught.append(lines)
        os.write(2, b"said\n")
        int("x")


def test_an_error_passes_and_the_stream_is_back(capfd):
    caught = []
    with pytest.raises(ValueError, match="invalid literal"):
        _fail(caught)
    os.write(2, b"after\n")
    assert caught == [["said"]]
    assert capfd.readouterr().err == "after\n"


def test_a_process_without_an_error_stream(capfd, monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    with catch_error_stream() as lines:
        os.write(2, b"said\n")
    assert lines == []
    assert capfd.readouterr().err == "said\n"
