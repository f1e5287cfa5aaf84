import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.mvnx import read_mvnx, write_mvnx
from besman.records import Recording

TEXT = """<?xml version="1.0" encoding="UTF-8"?>
<mvnx version="4" xmlns="http://www.xsens.com/mvn/mvnx">
<mvn version="2021.0" build="1"/>
<comment>frame &lt;position&gt;</comment>
<subject label="Suit" frameRate="60" segmentCount="2" recDate="x">
<segments><segment id="1" label="T8"><points><point label="a"><pos_b>0 0 0</pos_b></point></points>
</segment><segment id="2" label="RightHand"></segment></segments>
<frames segmentCount="2" sensorCount="0" jointCount="0">
<frame type="identity" index="-1"><orientation>1 0 0 0 1 0 0 0</orientation><position>0 0 0 0 0 0
</position></frame>
<frame time="0" tc="" ms="5" type="normal" index="4"><orientation>1 0 0 0 0 1 0 0</orientation>
<position>1 2 3 4 5 6</position><velocity>0 0 0 0 0 0</velocity></frame>
<frame time="16" tc="" ms="21" type="normal" index="5">
<orientation>1 0 0 0 0 0.6 0.8 0</orientation>
<position>1.5 2 3 4 5 -6e-1</position></frame>
</frames></subject></mvnx>
"""


def write(folder, text):
    path = folder / "run.mvnx"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text,
        lambda text: text.replace("<frame ", "<m:frame ").replace("</frame>", "</m:frame>"),
        lambda text: text.replace("UTF-8", "UTF-16").encode("utf-16"),
        lambda text: text.replace(' type="normal"', ""),
    ],
)
def test_segments(tmp_path, change):
    recording = read_mvnx(write(tmp_path, change(TEXT)))
    assert recording.names == ("T8", "RightHand")
    assert (recording.rate_hz, recording.first_frame, recording.source) == (60, 4, "run.mvnx")
    np.testing.assert_allclose(recording.time, np.array([4, 5]) / 60)
    np.testing.assert_array_equal(recording.positions[1], [[1.5, 2, 3], [4, 5, -0.6]])
    np.testing.assert_allclose(recording.orientations[1], [[1, 0, 0, 0], [0, 0.6, 0.8, 0]])


def frames_of(recording, path, kept):
    """Write a recording as MVNX, some frames left out."""
    write_mvnx(recording, path)
    parts = path.read_text().split("<frame ")
    path.write_text("<frame ".join([parts[0], *(parts[1 + row] for row in kept)]) + (
        "" if kept[-1] == len(parts) - 2 else "</frames></subject></mvnx>"
    ))  # fmt: skip


@pytest.mark.parametrize("with_times", [True, False])
def test_frames_that_are_missing_become_gaps(tmp_path, with_times):
    rng = np.random.default_rng(3)
    turns = rng.normal(size=(30, 2, 4))
    whole = Recording(
        (np.arange(30) + 7) / 60, rng.normal(size=(30, 2, 3)), ("T8", "RightHand"), 60.0,
        "whole.mvnx", 7,
        turns / np.linalg.norm(turns, axis=2, keepdims=True),
    )  # fmt: skip
    kept = [row for row in range(30) if row not in (4, 11, 12)]
    path = tmp_path / "holes.mvnx"
    frames_of(whole, path, kept)
    if not with_times:
        path.write_text(re.sub(r'time="\d+" ', "", path.read_text()))
    with pytest.warns(
        RecordingWarning, match="3 frames are missing and became gaps, first before frame 12 "
    ):
        found = read_mvnx(path)
    np.testing.assert_allclose(found.time, whole.time, rtol=1e-12)
    assert (found.rate_hz, found.first_frame) == (60.0, 7)
    np.testing.assert_allclose(found.positions[kept], whole.positions[kept], atol=1e-6)
    for values in (found.positions, found.orientations):
        assert np.flatnonzero(np.isnan(values).any(axis=(1, 2))).tolist() == [4, 11, 12]


def test_frames_that_jump_without_measure(tmp_path):
    text = TEXT.replace("</frames>", '<frame index="90" time="17"><position>1 2 3 4 5 6</position>'
                        "<orientation>1 0 0 0 0 1 0 0</orientation></frame></frames>")  # fmt: skip
    with pytest.raises(
        RecordingError, match=":16: frame 90 follows frame 5; expected frames that rise evenly"
    ):
        read_mvnx(write(tmp_path, text))


def test_without_orientations(tmp_path):
    lines = TEXT.replace("<orientation>", "<other>").replace("</orientation>", "</other>")
    assert read_mvnx(write(tmp_path, lines)).orientations is None


@pytest.mark.parametrize("rate_hz", [60.0, 240.0])
@pytest.mark.parametrize("with_orientations", [True, False])
def test_round_trip(tmp_path, rate_hz, with_orientations):
    rng = np.random.default_rng(0)
    quaternions = rng.normal(size=(30, 23, 4))
    quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
    recording = Recording(
        time=np.arange(7, 37) / rate_hz,
        positions=rng.normal(size=(30, 23, 3)),
        names=("R & <L>", *(f"S{index}" for index in range(22))),
        rate_hz=rate_hz,
        source="trip.mvnx",
        first_frame=7,
        orientations=quaternions if with_orientations else None,
    )
    write_mvnx(recording, tmp_path / "trip.mvnx")
    again = read_mvnx(tmp_path / "trip.mvnx")
    np.testing.assert_allclose(again.positions, recording.positions, atol=0.6e-6, rtol=0)
    np.testing.assert_array_equal(again.time, recording.time)
    if with_orientations:
        np.testing.assert_allclose(again.orientations, quaternions, atol=2e-6, rtol=0)
    else:
        assert again.orientations is None
    assert (again.names, again.rate_hz, again.first_frame) == (recording.names, rate_hz, 7)


@pytest.mark.parametrize("broken", ["name", "gap"])
def test_what_the_format_cannot_hold(tmp_path, broken):
    positions = np.zeros((3, 2, 3))
    if broken == "gap":
        positions[1, 1] = np.nan
    names = ("T8", None if broken == "name" else "RightHand")
    recording = Recording(np.arange(3) / 60, positions, names, 60.0, "x", 0)
    with pytest.raises(RecordingError, match=r"segment 2 .* has no name or has gaps"):
        write_mvnx(recording, tmp_path / "x.mvnx")


BOMB = """<?xml version="1.0"?>
<!DOCTYPE mvnx [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]>
<mvnx><comment>&c;&c;&c;</comment></mvnx>
"""


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: BOMB, r"run.mvnx:2: declares the document type or entity 'mvnx'"),
        (
            lambda text: '<!DOCTYPE mvnx SYSTEM "file:///etc/passwd"><mvnx/>',
            "run.mvnx:1: declares the document type",
        ),
        (lambda text: text.replace("1 2 3 4", "&a; 3 4"), "not valid XML: undefined entity"),
        (lambda text: "", "not valid XML: no element found; is the file cut"),
        (lambda text: text[:-60], "run.mvnx:15: not valid XML: .*; is the file cut"),
        (lambda text: text.replace("UTF-8", "nonsense-8"), "not valid XML"),
        (lambda text: "<html></html>", "run.mvnx:1: the root element is 'html'; expected 'mvnx'"),
        (lambda text: text.replace("RightHand", "T8"), ":7: two segments are named 'T8'"),
        (lambda text: text.replace('label="RightHand"', ""), ":7: a segment has no label"),
        (lambda text: text.replace('frameRate="60"', ""), "frameRate of the subject is ''"),
        (lambda text: text.replace('"60"', '"nan"'), "frameRate of the subject is 'nan'"),
        (
            lambda text: text.replace('nt="2" rec', 'nt="3" rec'),
            "2 segments, expected segmentCount 3",
        ),
        (lambda text: text.replace('index="5"', 'index="3"'), ":13: frame 3 follows frame 4"),
        (lambda text: text.replace('index="5"', 'index="x"'), "frame index is 'x'"),
        (lambda text: text.replace('time="16"', 'time="nan"'), "time is 'nan' ms after 0 ms"),
        (lambda text: text.replace('time="16"', 'time="-3"'), "time is '-3' ms after 0 ms"),
        (lambda text: text.replace('time="16"', 'time="?"'), r"time is '\?' ms"),
        (
            lambda text: text.replace("1 2 3 4 5 6", "1 2 3"),
            "position of frame 4: got 3 values, exp",
        ),
        (lambda text: text.replace("1 2 3 4", "1 2 x 4"), "position of frame 4: got 6 values"),
        (lambda text: text.replace("1 2 3 4", "1 2 inf 4"), "expected 6 numbers for 2 segments"),
        (lambda text: text.replace("0.6 0.8", "6 8"), "frame 5: expected unit quaternions"),
        (
            lambda text: text.replace("<position>1.5", "<pos>1.5").replace(
                "-6e-1</position>", "</pos>"
            ),
            "frame 5 has no position of segments",
        ),
        (
            lambda text: text.replace("<orientation>1 0 0 0 0 0.6 0.8 0</orientation>", ""),
            "frame 5: expected orientations in all frames or",
        ),
        (lambda text: text.replace('"normal"', '"tpose"'), "no frames of type 'normal'"),
        (lambda text: text.replace("</subject>", "</subject><subject/>"), "a second subject"),
    ],
)
def test_bad_files(tmp_path, change, message):
    with pytest.raises(RecordingError, match=message) as caught:
        read_mvnx(write(tmp_path, change(TEXT)))
    assert "\n" not in str(caught.value)


def test_missing_file(tmp_path):
    with pytest.raises(RecordingError, match=r"absent.mvnx: no such file"):
        read_mvnx(tmp_path / "absent.mvnx")
    with pytest.raises(RecordingError, match="cannot be read"):
        read_mvnx(tmp_path)


@settings(max_examples=200, deadline=None)
@given(at=st.integers(0, len(TEXT) - 1), text=st.text(max_size=3), length=st.integers(0, len(TEXT)))
def test_damage_ends_in_one_line(tmp_path_factory, at, text, length):
    folder = tmp_path_factory.getbasetemp()
    damaged = TEXT[:at] + text + TEXT[at + len(text) :]
    try:
        read_mvnx(write(folder, damaged.encode("utf-8", "replace")[: max(length, at)]))
    except RecordingError as error:
        assert "\n" not in str(error)  # noqa: PT017
