import json
import os
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.exceptions import RecordingError
from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import read_recording
from besman.io.segments_json import (
    ThrowEvent,
    find_segments,
    read_segments,
    read_throws,
    segments_path,
    write_segments,
)
from besman.records import LabelledSegments, Recording
from besman.records.layers import LAYERS, stack_layers

REAL = Path(
    os.environ.get("BESMAN_REAL_DATA", Path(__file__).parents[2].parent / "shared" / "data")
)
RECORDING = Recording(
    time=np.arange(100) / 60,
    positions=np.zeros((100, 1, 3)),
    names=("a",),
    rate_hz=60.0,
    source="run.tsv",
    first_frame=690,
)
ROWS = [
    {"start index": 700, "end index": 720, "label": "reach"},
    {"start index": 690, "end index": 695, "label": "reach_part"},
    {"start index": 690, "end index": 700, "label": "idle"},
]
THROW = ThrowEvent(
    release_frame=712,
    release_time_s=1.5,
    touchdown_time_s=2.25,
    release_m=(0.1, 0.2, 1.7),
    touchdown_m=(1.8, 0.3, 0.0),
)


def write(folder: Path, content: object) -> Path:
    path = folder / "run_manually_segmented.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


@pytest.mark.parametrize("content", [ROWS, {"segments": ROWS, "events": {"throws": []}}])
def test_rows_of_absolute_frames(tmp_path, content):
    segments = read_segments(write(tmp_path, content), RECORDING)
    np.testing.assert_array_equal(segments.bounds, [[0, 10], [10, 30]])
    assert segments.labels == ("idle", "reach")
    np.testing.assert_array_equal(segments.distances, [0, 0])
    assert (segments.rate_hz, segments.source, segments.first_frame) == (60, "run.tsv", 690)


def test_parts_on_request(tmp_path):
    segments = read_segments(write(tmp_path, ROWS), RECORDING, keep_parts=True)
    assert segments.labels == ("reach_part", "idle", "reach")


def test_no_segments(tmp_path):
    assert read_segments(write(tmp_path, []), RECORDING).bounds.shape == (0, 2)


@pytest.mark.parametrize("throws", [None, (), (THROW, THROW)])
def test_round_trip(tmp_path, throws):
    segments = read_segments(write(tmp_path, ROWS), RECORDING)
    path = tmp_path / "again.json"
    write_segments(segments, path, throws)
    again = read_segments(path, RECORDING)
    np.testing.assert_array_equal(again.bounds, segments.bounds)
    assert again.labels == segments.labels
    assert read_throws(path) == (throws or ())


def layered(start, end, label, layer):
    return {"start index": start, "end index": end, "label": label, "layer": layer}


LAYERED = [
    layered(690, 740, "lift", "actions"),
    layered(690, 700, "idle", "left_hand"),
    layered(690, 720, "reach", "right_hand"),
    layered(692, 700, "reach_part", "right_hand"),
    layered(720, 740, "hold", "right_hand"),
    {"start index": 700, "end index": 730, "label": "note"},
]


def test_layers_are_read_and_written(tmp_path):
    path = write(tmp_path, LAYERED)
    segments = read_segments(path, RECORDING)
    assert segments.labels == ("idle", "reach", "lift", "note", "hold")
    assert segments.layers == ("left_hand", "right_hand", "actions", "", "right_hand")
    write_segments(segments, path)
    rows = json.loads(path.read_text())
    assert [row.get("layer") for row in rows] == [name or None for name in segments.layers]


NAMES = st.sampled_from(["reach", 'a "b" <c>', "Drücken", "idle"])


@st.composite
def layers(draw):
    """Segments of some layers, in no layer where it is called ""."""
    found = {}
    for name in draw(st.lists(st.sampled_from(["", *LAYERS, "actions_2"]), unique=True)):
        borders = sorted(draw(st.sets(st.integers(0, 100), min_size=2, max_size=8)))
        n = len(borders) - 1
        found[name] = LabelledSegments(
            np.stack([borders[:-1], borders[1:]], axis=1),
            tuple(draw(st.lists(NAMES, min_size=n, max_size=n))),
            np.zeros(n),
            60.0,
            "run.tsv",
            690,
        )
    return found


@given(layers())
@settings(deadline=None)
def test_layers_survive_a_round_trip(tmp_path_factory, found):
    if not found:
        return
    segments = stack_layers(found)
    path = tmp_path_factory.mktemp("round") / "run_manually_segmented.json"
    write_segments(segments, path)
    again = read_segments(path, RECORDING)
    np.testing.assert_array_equal(again.bounds, segments.bounds)
    assert (again.labels, again.layers) == (segments.labels, segments.layers)
    for name, layer in found.items():
        rows = [k for k, one in enumerate(again.layers or ("",) * len(again.labels)) if one == name]
        np.testing.assert_array_equal(again.take(rows).bounds, layer.bounds)
        assert again.take(rows).labels == layer.labels


def test_beside_the_recording(tmp_path):
    recording = tmp_path / "run.tsv"
    assert find_segments(recording) is None
    path = write(tmp_path, ROWS)
    assert find_segments(recording) == path == segments_path(recording)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", r"json:1: not valid JSON"),
        ("3", "expected a list of segments or an object"),
        ({"events": {}}, "expected a list of segments or an object"),
        ([3], r"segment 1: got 3, expected the keys start index, end index, label"),
        ([ROWS[0], {"start index": 3}], r"segment 2: got .* expected the keys"),
        ([{**ROWS[0], "label": 3}], "segment 1: got .* expected two frame numbers and a label"),
        ([{**ROWS[0], "start index": 1.5}], "expected two frame numbers"),
        (
            [{**ROWS[0], "start index": 3}],
            r"\(reach\): frames 3 to 720 do not lie .* 690 to 789",
        ),
        ([{**ROWS[0], "end index": 791}], "frames 700 to 791 do not lie"),
        ([{**ROWS[0], "end index": 700}], "frames 700 to 700 .* or end before they start"),
        ([{**ROWS[0], "Layer": "actions"}], "segment 1: no key 'Layer'; did you mean 'layer'"),
        ([{**ROWS[0], "layer": "right"}], r"\(reach\): no layer 'right'; .*right_hand"),
        ([{**ROWS[0], "layer": ""}], "no layer ''; allowed: .*actions"),
        ([{**ROWS[0], "layer": None}], "no layer None"),
        (
            [layered(710, 730, "b", "right_hand"), ROWS[2], layered(700, 711, "a", "right_hand")],
            r"segment 3 \(a, frames 700 to 711\) and segment 1 \(b, frames 710 to 730\) overlap in "
            "layer 'right_hand'",
        ),
    ],
)
def test_bad_files(tmp_path, content, message):
    with pytest.raises(RecordingError, match=message):
        read_segments(write(tmp_path, content), RECORDING)


def test_missing_and_unreadable(tmp_path):
    with pytest.raises(RecordingError, match="no such file"):
        read_segments(tmp_path / "absent.json", RECORDING)
    path = tmp_path / "binary.json"
    path.write_bytes(b"\xff\xfe\xff")
    with pytest.raises(RecordingError, match="cannot be read as text"):
        read_segments(path, RECORDING)


@pytest.mark.parametrize(
    "events",
    [
        {},
        {"throws": 3},
        {"throws": [{"release_frame": 3}]},
        {"throws": [3]},
        *(
            {"throws": [asdict(replace(THROW, **change))]}
            for change in (
                {"touchdown_time_s": 1_000_001},
                {"touchdown_time_s": -1.0},
                {"release_time_s": 2e5, "touchdown_time_s": 2e5 + 1},
                {"release_frame": -1},
                {"release_m": [0.0, 0.0, 1e4]},
            )
        ),
    ],
)
def test_bad_events(tmp_path, events):
    with pytest.raises(RecordingError, match="events: expected 'throws', a list of objects with"):
        read_throws(write(tmp_path, {"segments": [], "events": events}))


def test_bare_list_has_no_events(tmp_path):
    assert read_throws(write(tmp_path, ROWS)) == ()


@pytest.mark.skipif(not REAL.is_dir(), reason="the real recordings are not on this machine")
def test_real_segments():
    n_segments = 0
    for path in find_recordings([REAL / "pick_and_place"]):
        found = find_segments(path)
        assert found is not None
        segments = read_segments(found, read_recording(path))
        n_segments += len(segments.labels)
        assert not any(label.endswith("_part") for label in segments.labels)
        assert "approach_forward" in segments.labels
    assert n_segments > 70
