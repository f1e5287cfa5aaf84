import functools
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request

import pytest
from command_line import besman
from web_session import enter

from besman.annotate.skeleton import find_bones
from besman.annotate.sources import load_models, split_labels
from besman.exceptions import AnnotationError, RecognitionError, RunError


def run(monkeypatch, *arguments):
    return besman(monkeypatch, "annotate", *arguments, "--no-browser")


def test_command_serves_until_it_is_stopped(recording_path, segments_path, monkeypatch, capsys):
    command = [sys.executable, "-m", "besman", "annotate", str(recording_path), "--no-browser"]
    # Where tests run in the background Ctrl-C is ignored, and so it would be by what they start.
    heed = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, preexec_fn=heed)
    try:
        said = [server.stdout.readline() for _ in range(3)]
        assert str(segments_path) in said[0]
        url = re.search(r"http://127\.0\.0\.1:\d+/\S+/", said[1])[0]
        enter(url)
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(url)
        port = re.search(r":(\d+)/", url)[1]
        assert run(monkeypatch, recording_path, "--port", port) == 2
        message = f"besman: error: --port {port}: is in use; give another one"
        assert message in capsys.readouterr().err
    finally:
        server.send_signal(signal.SIGINT)
        assert server.wait(120) == 0
    assert not segments_path.exists()


def test_what_is_wrong_is_one_line_and_nothing_is_written(
    recording_path, tmp_path, monkeypatch, capsys
):
    before = sorted(tmp_path.iterdir())
    assert run(monkeypatch, recording_path, "--segments", tmp_path / "no" / "s.json") == 2
    said = capsys.readouterr().err
    assert said.startswith("besman: error: ")
    assert "cannot be written: no folder" in said
    assert len(said.splitlines()) == 1
    assert sorted(tmp_path.iterdir()) == before


def test_labels_are_separated_by_commas():
    assert split_labels(None) == ()
    assert split_labels("throw, strike_out") == ("throw", "strike_out")
    with pytest.raises(AnnotationError, match="got 'throw,,idle', expected names separated by"):
        split_labels("throw,,idle")


def test_models_that_are_not_there_are_said(tmp_path):
    with pytest.raises(RunError, match="no trained model here"):
        load_models(tmp_path, None)
    with pytest.raises(RecognitionError, match="cannot be read"):
        load_models(None, tmp_path / "model")


def test_bones_join_markers_by_their_names():
    names = (
        "Hand top",
        None,
        "Elbow",
        "right_shoulder",
        "Back top",
        "left_elbow",
        "Left Hand Left",
    )
    joined = {frozenset((names[a], names[b])) for a, b in find_bones(names)}
    assert joined == {
        frozenset(("Left Hand Left", "left_elbow")),
        frozenset(("Back top", "right_shoulder")),
    }
    names = ("back_top", "shoulder", "elbow", "hand_top", "hand_left", "hand_right")
    assert (0, 1) in find_bones(names)
    assert (1, 2) in find_bones(names)
    assert find_bones(("a", None)) == []
