import http.client
import json
import shutil

import numpy as np
import pytest
from web_session import session

from besman.annotate.session import Session
from besman.exceptions import AnnotationError, RecordingError
from besman.io.recordings.formats import read_recording, write_recording
from besman.io.segments_json import read_segments
from besman.records import Recording


def ask(server, method, name, content=None, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=30)
    place, cookie = session(server)
    headers = {"Cookie": cookie} | headers
    body = None if content is None else json.dumps(content)
    if body is not None:
        headers["Content-Type"] = "application/json"
    connection.request(method, f"{place}{name}", body, headers)
    answer = connection.getresponse()
    data = answer.read()
    is_json = answer.headers["Content-Type"] == "application/json"
    return answer.status, json.loads(data) if is_json else data


def save(server, rows, revision="", **more):
    content = {"recording": 0, "segments": rows, "revision": revision, **more}
    return ask(server, "POST", "save", content)


def test_page_and_all_it_loads_are_there(serve, recording_path):
    server = serve(recording_path)
    status, page = ask(server, "GET", "")
    assert status == 200
    names = {part.split(b'"')[0] for part in page.split(b'="')[1:]}
    files = [name.decode() for name in names if name.endswith((b".js", b".css"))]
    assert len(files) > 10
    for name in files:
        assert ask(server, "GET", name)[0] == 200
    assert b"http:" not in page
    assert b"https:" not in page


def test_without_token_or_with_a_foreign_host_nothing_is_told_or_written(
    serve, recording_path, segments_path
):
    server = serve(recording_path)
    rows = {"recording": 0, "segments": [[0, 9, "a", ""]], "revision": ""}
    for headers in ({"Cookie": ""}, {"Cookie": "besman=x"}, {"Host": "evil.example"}):
        assert ask(server, "GET", "session", None, **headers)[0] == 403
        assert ask(server, "POST", "save", rows, **headers)[0] == 403
    assert ask(server, "GET", "../server.py")[0] == 400
    assert not segments_path.exists()


def test_recording_is_described_and_its_signals_are_those_of_the_file(serve, recording_path):
    server = serve(recording_path, labels=("throw",))
    recording = read_recording(recording_path)
    assert ask(server, "GET", "session")[1]["labels"] == ["throw"]
    about = ask(server, "GET", "recording?recording=0")[1]
    assert about["n_samples"] == len(recording.time)
    assert about["markers"] == list(recording.names)
    assert about["segments"] == []
    assert about["revision"] == ""
    frames = np.frombuffer(ask(server, "GET", "frames?recording=0&index=0")[1], np.float32)
    np.testing.assert_array_equal(
        frames.reshape(-1, *recording.positions.shape[1:]),
        recording.positions[:4096].astype(np.float32),
    )


def test_save_writes_what_besman_reads(serve, recording_path, segments_path):
    server = serve(recording_path)
    rows = [[10, 60, "swing", ""], [60, 90, "throw", ""]]
    status, answer = save(server, rows)
    assert status == 200
    read = read_segments(segments_path, read_recording(recording_path))
    assert read.labels == ("swing", "throw")
    assert ask(server, "GET", "revision?recording=0")[1] == answer
    status, answer = save(server, rows[:1], answer["revision"])
    assert (status, len(read_segments(segments_path, read_recording(recording_path)).labels)) == (
        200,
        1,
    )


def test_file_changed_underneath_is_a_conflict(serve, recording_path, segments_path):
    server = serve(recording_path)
    _, answer = save(server, [[10, 60, "mine", ""]])
    theirs = '[{"start index": 1, "end index": 9, "label": "theirs"}]'
    segments_path.write_text(theirs)
    status, conflict = save(server, [[10, 60, "mine", ""]], answer["revision"])
    assert status == 409
    assert conflict["changed"] is True
    assert "another window or program changed it" in conflict["error"]
    assert segments_path.read_text() == theirs
    assert ask(server, "GET", "recording?recording=0")[1]["segments"] == [[0, 8, "theirs", ""]]
    status, _ = save(server, [[10, 60, "mine", ""]], answer["revision"], replace=True)
    assert status == 200
    assert "mine" in segments_path.read_text()
    assert segments_path.with_name(segments_path.name + ".bak").read_text() == theirs


def test_two_sessions_on_one_file_do_not_overwrite_each_other(serve, recording_path):
    one, other = serve(recording_path), serve(recording_path)
    assert save(one, [[10, 60, "one", ""]])[0] == 200
    assert save(other, [[10, 60, "other", ""]])[0] == 409


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "expected an object"),
        ({"recording": 1}, "recording: got '1', expected 0 to 0"),
        ({"recording": 0, "segments": [[0, 10**9, "a", ""]]}, "do not lie in the recording"),
        (
            {"recording": 0, "segments": [[0, 9, "a", "actions"], [5, 12, "b", "actions"]]},
            "overlap in layer 'actions'",
        ),
    ],
)
def test_what_cannot_be_saved_is_said_and_nothing_is_written(
    serve, recording_path, segments_path, content, message
):
    status, answer = ask(serve(recording_path), "POST", "save", content)
    assert status == 422
    assert message in answer["error"]
    assert not segments_path.exists()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("recording?recording=-1", "recording: got '-1', expected 0 to 0"),
        ("recording", "recording: got '', expected 0 to 0"),
        ("frames?recording=0&index=x", "index: got 'x', expected a whole number from 0"),
    ],
)
def test_what_is_asked_wrongly_is_said(serve, recording_path, name, message):
    status, answer = ask(serve(recording_path), "GET", name)
    assert status == 422
    assert message in answer["error"]


@pytest.mark.parametrize(
    ("layer", "note"),
    [
        ("actions", "proposals are for the layers of hands"),
        ("left_hand", "marker set right_arm has no role 'left_hand'"),
    ],
)
def test_why_there_are_no_proposals_is_said(serve, recording_path, layer, note):
    status, answer = ask(serve(recording_path), "GET", f"stretches?recording=0&layer={layer}")
    assert (status, answer["stretches"]) == (200, [])
    assert note in answer["note"]


@pytest.mark.parametrize("bounds", [None, [[5, 5]], [[0, 10**7]], [[0, 1.5]], ["x"]])
def test_bounds_are_checked(serve, recording_path, bounds):
    content = {"recording": 0, "layer": "", "segments": [], "bounds": bounds}
    status, answer = ask(serve(recording_path), "POST", "names", content)
    assert status == 422
    assert "bounds: got" in answer["error"]


def test_recording_without_a_visible_marker_is_refused(tmp_path):
    path = tmp_path / "empty.tsv"
    hidden = np.full((50, 2, 3), np.nan)
    write_recording(Recording(np.arange(50) / 50, hidden, ("a", "b"), 50.0, path.name), path)
    with pytest.raises(AnnotationError, match="no marker is visible in any of 50 frames"):
        Session([path])
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_one_segments_file_is_for_one_recording(recording_path, tmp_path):
    other = tmp_path / "other.tsv"
    shutil.copy(recording_path, other)
    with pytest.raises(AnnotationError, match="belongs to one recording, got 2"):
        Session([recording_path, other], segments=tmp_path / "s.json")
    twin = tmp_path / "throws.c3d"
    write_recording(read_recording(recording_path), twin)
    with pytest.raises(AnnotationError, match="have the same segments file"):
        Session([recording_path, twin])


def test_segments_of_another_recording_are_refused(recording_path, tmp_path):
    path = tmp_path / "s.json"
    path.write_text('[{"start index": 1, "end index": 999999, "label": "a"}]')
    with pytest.raises(RecordingError, match="do not lie in the recording's frames"):
        Session([recording_path], segments=path)
