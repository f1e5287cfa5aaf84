import json
from dataclasses import replace

import numpy as np
import pytest
from free_throws import with_landing

from besman.exceptions import ConfigError, RecordingWarning
from besman.io.landings import read_landings
from besman.io.recordings.formats import read_recording
from besman.io.ring_landings import find_ring_landing
from besman.records import Landing
from besman.synthetic.free_throw import simulate_free_throw


def test_a_table_says_its_unit_in_its_columns(tmp_path):
    path = tmp_path / "landings.csv"
    path.write_text("recording,throw,x_ft,y_ft\nann.tsv,1,10,1\nann.tsv,2,12,-1\n")
    found = read_landings(path)
    assert [(one.recording, one.throw) for one in found] == [("ann.tsv", 1), ("ann.tsv", 2)]
    np.testing.assert_allclose(found[1].place, [3.6576, -0.3048, 0.0])


def test_a_height_is_read_where_it_is_given(tmp_path):
    path = tmp_path / "landings.csv"
    path.write_text("recording, x_mm, y_mm, z_mm\nann, 100, 200, 300\n")
    np.testing.assert_allclose(read_landings(path)[0].place, [0.1, 0.2, 0.3])


@pytest.mark.parametrize("ending", ["yaml", "json"])
def test_places_on_a_hoop_are_brought_into_the_recordings_frame(tmp_path, ending):
    """From the front of the hoop, x to the right of who throws, y away, inches."""
    path = tmp_path / f"landings.{ending}"
    content = {
        "units": "in",
        "origin_m": [12.5, 0.0, 3.048],
        "x_axis": [0.0, -1.0, 0.0],
        "y_axis": [1.0, 0.0, 0.0],
        "landings": {"T1": [-2.0, 10.0], "T2": [[1.0, 9.0], [0.0, 8.0, 1.0]]},
    }
    path.write_text(json.dumps(content))
    found = read_landings(path)
    assert [(one.recording, one.throw) for one in found] == [("T1", 1), ("T2", 1), ("T2", 2)]
    np.testing.assert_allclose(found[0].place, [12.5 + 0.254, 0.0508, 3.048])
    np.testing.assert_allclose(found[2].place, [12.5 + 0.2032, 0.0, 3.048 + 0.0254])


def test_a_landing_is_that_of_its_recording_with_or_without_ending():
    landing = Landing("T1", 2, np.zeros(3))
    assert landing.is_of("T1.json", 2)
    assert landing.is_of("T1", 2)
    assert not landing.is_of("T1.json", 1)
    assert not landing.is_of("T11.json", 2)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "recording,x,y\nann,1,2\n", r"a\.csv: columns recording, x, y; expected record"),
        ("a.csv", "", r"a\.csv: columns none; expected recording, x_m, y_m"),
        ("a.csv", "recording,x_m,y_m\n", r"a\.csv: no landings below the header"),
        ("a.csv", "recording,x_m,y_m\nann,1,far\n", r"a\.csv:2: y_m: got 'far'; expected a number"),
        ("a.csv", "recording,x_m,y_m\nann,1,inf\n", r"a\.csv:2: y_m: got 'inf'; expected"),
        ("a.yaml", "landings: {ann: [1, 2]}\n", r"a\.yaml.*units"),
        ("a.csv", "recording,x_m,y_m\nann,1,\n", r"a\.csv:2: y_m: got ''; expected a number"),
        ("a.csv", "recording,x_m,y_m\nann,1,1_0\n", r"a\.csv:2: y_m: got '1_0'"),
        ("a.csv", "recording,x_m,y_m\nann,1,2e3\n", r"a\.csv:2: ann comes down at .* within 1000"),
        ("a.csv", "recording,x_m,y_m\n ,1,2\n", r"a\.csv:2: recording '' is empty"),
        ("a.csv", "recording,x_m,y_m\na\x1b,1,2\n", r"a\.csv:2: recording .* U\+001B"),
        ("a.csv", "recording,x_m,y_m,throw\nann,1,2,0\n", r"a\.csv:2: throw: got '0'; expected"),
        (
            "a.csv",
            "recording,x_m,y_m\na,1,2\na,1,3\n",
            r"throw 1 of a comes down 2 times; expected",
        ),
        (
            "a.csv",
            f"recording,x_m,y_m\n{200_000 * 'x'},1,2\n",
            r"a\.csv:1: field larger .* a table",
        ),
        ("a.yaml", "units: m\nlandings: {a: [2000, 1]}\n", r"a\.yaml: a comes down at .* within"),
        ("a.yaml", "units: m\nlandings: {}\n", r"a\.yaml.*expected a place \[x, y\]"),
        ("a.yaml", "units: m\nx_axis: [2, 0, 0]\nlandings: {a: [1, 2]}\n", "direction of length 1"),
        (
            "a.yaml",
            "units: m\nlandings: {a: []}\n",
            r"a\.yaml:2: landings\.a.*: got \[\]; tuple should",
        ),
        ("a.yaml", "units: miles\nlandings: {a: [1, 2]}\n", r"a\.yaml:1: units"),
    ],
)
def test_what_is_no_landing_file_is_refused(tmp_path, name, text, message):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(ConfigError, match=message):
        read_landings(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.csv: no such file"):
        read_landings(tmp_path / "none.csv")


def test_a_table_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"a\.csv: cannot be read as text"):
        read_landings(path)


def test_the_landing_of_a_recordings_own_file(free_throw_recording):
    """In a court's frame, however that lies: what was thrown passed the ring there."""
    throw, recording = free_throw_recording
    found = find_ring_landing(recording)
    assert (found.recording, found.throw) == (recording.source, 1)
    np.testing.assert_allclose(found.place, throw.landing(3.048), atol=1e-9)
    middle = np.array([47.0, -25.0, 0.0]) * 0.3048  # of the court, seen from a corner
    for turned in (1.0, -1.0):
        moved = replace(recording, positions=recording.positions * [turned, turned, 1] + middle)
        place = find_ring_landing(moved).place
        np.testing.assert_allclose(place, found.place * [turned, turned, 1] + middle, atol=1e-9)


def test_no_ring_is_near(free_throw_recording):
    _, recording = free_throw_recording
    away = replace(recording, positions=recording.positions - [6.3, 0.0, 0.0])
    with pytest.warns(
        RecordingWarning, match=r"no ring of an NBA court .* at 2\.\d, -?0\.0 m; a landing file"
    ):
        assert find_ring_landing(away) is None
    assert find_ring_landing(replace(recording, origin=None)) is None


@pytest.fixture
def free_throw_recording(tmp_path):
    throw = simulate_free_throw(1)
    path = tmp_path / "T1.json"
    path.write_text(json.dumps(with_landing(throw)))
    return throw, read_recording(path)


@pytest.mark.parametrize("said", [None, "near", float("nan"), 500.0, True])
def test_a_landing_that_is_none(tmp_path, said):
    throw = simulate_free_throw(1)
    path = tmp_path / "T1.json"
    path.write_text(json.dumps({**throw.content, "landing_x": 1.0, "landing_y": said}))
    assert find_ring_landing(read_recording(path)) is None
