# ruff: noqa: E501
import json

import numpy as np
import pytest
from foreign_recordings import keypoint_frames, keypoint_table, write_lines

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.formats import read_recording, recognise
from besman.io.recordings.keypoints import read_keypoints
from besman.io.recordings.keypoints_csv import read_keypoints_csv
from besman.records import Recording

RNG = np.random.default_rng(0)
CONCLUDING = pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
NAMES = ("NOSE", "RIGHT_SHOULDER", "RIGHT_HIP", "RIGHT_ANKLE", "ball")
PLACES = [[0, 0, 1.7], [0, -0.2, 1.4], [0, -0.1, 0.9], [0, -0.1, 0.1], [0.3, -0.2, 3.9]]


def throw(n_samples=24, first_frame=0, rate_hz=30.0):
    time = np.arange(n_samples) / rate_hz
    positions = np.array(PLACES) + 0.05 * np.sin(time)[:, None, None]
    positions[3:5, 2] = positions[-4:, 4] = np.nan
    return Recording(time, positions, NAMES, rate_hz, "a.json", first_frame)


def write(content, path):
    path.write_text(json.dumps(content))
    return path


def assert_is(found, written, atol=1e-6):
    np.testing.assert_allclose(found.positions, written.positions, atol=atol)
    np.testing.assert_allclose(found.time, written.time, atol=1e-5)
    assert (found.names, found.rate_hz) == (written.names, written.rate_hz)
    assert found.first_frame == written.first_frame


@CONCLUDING
@pytest.mark.parametrize(
    "wrapped", ["list", "frames", "tracking", "data", "nulls", "lists", "bare"]
)
def test_forms_of_frames(tmp_path, wrapped):
    written = throw(first_frame=1 if wrapped in ("lists", "bare") else 0)
    frames = keypoint_frames(written)
    content = {"fps": 30, "units": "m", wrapped: frames}
    if wrapped == "list":
        content = frames
    elif wrapped == "tracking":
        # As in a public set of free throws: at depth, times in milliseconds, no units.
        content = {"sampling_rate": 30, "result": "made", "landing_x": 1.5, "tracking": [
            {"frame": one["frame"], "time": int(1000 * one["time"]),
             "data": {"player": {k: v for k, v in one["keypoints"].items() if k != "ball"},
                      "ball": one["keypoints"]["ball"]}}
            for one in frames
        ]}  # fmt: skip
    elif wrapped == "nulls":
        text = json.dumps(content).replace("[NaN, NaN, NaN]", "[null, null, null]")
        content = json.loads(text)
        content["frames"] = content.pop("nulls")
    elif wrapped == "lists":
        content = {"fps": 30, "units": "m", "keypoints": {
            name: [one["keypoints"][name] for one in frames] for name in NAMES}}  # fmt: skip
    elif wrapped == "bare":
        content = {"fps": 30, "frames": [one["keypoints"] for one in frames]}
    found = read_keypoints(write(content, tmp_path / "a.json"))
    assert_is(found, written)
    assert recognise((tmp_path / "a.json").read_bytes()).name == "keypoints JSON"


@pytest.mark.parametrize(("units", "scale"), [("ft", 1 / 0.3048), ("m", 1), ("cm", 100), ("mm", 1000), ("in", 1 / 0.0254)])  # fmt: skip
def test_the_height_of_the_body_tells_the_units(tmp_path, units, scale):
    written = throw()
    path = write({"fps": 30, "frames": keypoint_frames(written, scale)}, tmp_path / "a.json")
    with pytest.warns(
        RecordingWarning, match=rf"the body is .* high, so they are taken for {units}"
    ):
        found = read_keypoints(path)
    assert_is(found, written)
    assert found.origin.units_by == "the size of a person"
    assert_is(read_keypoints(path, units=units), written)


def test_what_the_file_says_of_units_and_up(tmp_path):
    written = throw()
    content = {
        "fps": 30,
        "units": "feet",
        "up": "y",
        "frames": keypoint_frames(written, 1 / 0.3048),
    }
    found = read_keypoints(write(content, tmp_path / "a.json"))
    assert (found.origin.units, found.origin.up, found.origin.up_by) == ("ft", "y", "the file")
    content["up"] = "sideways"
    assert read_keypoints(write(content, tmp_path / "a.json")).origin.up_by == ""


def test_a_frame_that_lacks_a_name(tmp_path):
    written = throw()
    frames = keypoint_frames(written)
    del frames[7]["keypoints"]["NOSE"]
    path = write({"fps": 30, "units": "m", "frames": frames}, tmp_path / "a.json")
    found = read_recording(path)
    assert np.isnan(found.positions[7, 0]).all()


def test_a_name_that_is_empty_is_none(tmp_path):
    frames = keypoint_frames(throw())
    for frame in frames:
        frame["keypoints"][""] = frame["keypoints"].pop("NOSE")
    path = write({"fps": 30, "units": "m", "frames": frames}, tmp_path / "a.json")
    assert None in read_recording(path).names
    assert "" not in read_recording(path).names


def test_a_time_or_rate_that_is_no_number_is_said(tmp_path):
    frames = keypoint_frames(throw())
    frames[4]["time"] = "1e3"
    path = write({"fps": 30, "units": "m", "frames": frames}, tmp_path / "a.json")
    with pytest.warns(RecordingWarning, match="time of frame 5 is '1e3', no number; time is left"):
        read_recording(path)
    frames = keypoint_frames(throw())
    path = write({"fps": "3_0", "units": "m", "frames": frames}, tmp_path / "b.json")
    with pytest.warns(RecordingWarning, match="no number where the rate stands; 30, as"):
        assert read_recording(path).rate_hz == 30.0


@CONCLUDING
@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "no frames; expected a list"),
        ([{"a": [1, 2, 3], "b": [1, 2, 3]}] * 3, "neither the header nor a column of times"),
        ({"fps": 30, "frames": [{"a": [1, 2, "x"]}] * 3}, r"frame 1: 'a' is .* expected three numbers"),
        ({"fps": 30, "frames": [{"a": [1, 2, 3]}, 7]}, "frame 2: got 7; expected positions by name"),
        ({"fps": 30, "frames": [{"a": 1}] * 3}, "no positions by name; expected three numbers"),
        ({"fps": 30, "a": [[1, 2, 3]] * 3, "b": [[1, 2, 3]] * 2}, "'a' has 3 positions and 'b' 2"),
        ({"fps": 30, "units": "m", "frames": [{"a": [1, 2, 3]}]}, "a recording of one frame"),
        ({"fps": 30, "units": "m", "frames": [{"a": [1, 2, 3], "time": 3 - k} for k in range(3)]}, "expected rising times"),
        ({"fps": 30, "frames": [{f"a{k}": [k, 2, 3] for k in range(10_001)}] * 3}, "more than 10000 names"),
        ([{"trial": k, "tracking": [{"a": [1, 2, 3], "b": [1, 2, 3]}] * 3} for k in range(4)], "4 recordings with frames of their own; expected one a file: jq"),
        ({"fps": 30, "trials": {"T1": {"frames": [{"a": [1, 2, 3], "b": [1, 2, 3]}] * 3}}}, "1 recordings with frames of their own"),
        ("{", "not valid JSON: .*is the file cut"),
        (" ", "the file is empty; expected keypoints in JSON"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(tmp_path, content, message):
    path = tmp_path / "a.json"
    path.write_text(content) if isinstance(content, str) else write(content, path)
    with pytest.raises(RecordingError, match=message) as caught:
        read_keypoints(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "content",
    [
        {"frames": [[1, 2], [3, 4]], "labels": ["a"]},
        {"target_m": [1, 2, 3], "trajectories": ["a"]},
        {"rate_hz": 100, "frames": [[1, 2]], "throws": [{"from_m": [1, 2, 3], "to_m": [1, 2, 3]}]},
        {"position_error_m": {"mean": 1}, "frames": [0, 1, 2]},
        {"a": [1.0, 2.0, 3.0], "b": [1.0, 2.0, 3.0]},
    ],
)
def test_other_json_is_none(content):
    assert recognise(json.dumps(content).encode()) is None


@pytest.mark.parametrize("sep", [",", ";", "\t"])
@pytest.mark.parametrize("joint", ["_", ".", " "])
def test_a_table(tmp_path, sep, joint):
    written = throw()
    lines = keypoint_table(written, sep)
    for axis in "xyz":
        lines[1] = lines[1].replace(f"_{axis}", f"{joint}{axis}")
    path = write_lines(lines, tmp_path / "a.csv")
    assert_is(read_keypoints_csv(path), written)
    assert recognise(path.read_bytes()).name == "keypoints CSV"


def test_a_table_of_milliseconds_without_units(tmp_path):
    written = throw()
    lines = keypoint_table(written)[1:]
    lines[0] = lines[0].replace("frame,time", "frame,time_ms")
    rows = [line.split(",") for line in lines[1:]]
    lines[1:] = [",".join([row[0], f"{1000 * float(row[1]):.3f}", *row[2:]]) for row in rows]
    with pytest.warns(RecordingWarning, match="taken for m, by the size of a person"):
        assert_is(read_keypoints_csv(write_lines(lines, tmp_path / "a.csv")), written)


def test_a_table_with_its_rate_above(tmp_path):
    written = throw(first_frame=1)
    lines = [line.split(",", 2)[-1] for line in keypoint_table(written)]
    lines[0] = "# units: m"
    path = write_lines(["# fps: 30", *lines], tmp_path / "a.csv")
    assert_is(read_keypoints_csv(path), written)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["frame,a_x,a_y", "1,2,3"], "no keypoint with three columns"),
        (["a_x,a_y,a_z", "1,2,3", "1,2,3"], "neither the header nor a column of times"),
        (["time,a_x,a_y,a_z"], "no frames after the header"),
    ],
)
def test_a_table_that_is_wrong(tmp_path, lines, message):
    with pytest.raises(RecordingError, match=message):
        read_keypoints_csv(write_lines(lines, tmp_path / "a.csv"))


def test_units_by_the_height_of_one_of_several_people(tmp_path):
    places = {"nose": 160.0, "right_wrist": 90.0, "left_ankle": 8.0}
    frame = {
        f"person{k}:{name}": [250.0 * k, 0.0, height]
        for k in range(3) for name, height in places.items()
    }  # fmt: skip
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"fps": 30, "frames": [frame] * 3}))
    with pytest.warns(RecordingWarning, match="the body is 152 high, so they are taken for cm"):
        assert read_keypoints(path).origin.units == "cm"
