# ruff: noqa: E501
"""Ways in which JSON and tables hold keypoints: each gives back the recording that it was made of."""

import json
from itertools import chain

import numpy as np
import pytest

from besman.exceptions import RecordingError
from besman.io.recordings.formats import read_recording, recognise
from besman.io.recordings.keypoint_columns import find_columns, is_keypoint_table, join_header

CONCLUDING = pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
NAMES = ("nose", "right_shoulder", "right_hip", "right_ankle", "ball")
PLACES = [[0, 0, 1.7], [0, -0.2, 1.4], [0, -0.1, 0.9], [0, -0.1, 0.1], [0.3, -0.2, 2.9]]
N_FRAMES = 12
# Of the ball nothing is seen in the beginning.
POSITIONS = np.round(np.array(PLACES) + 0.05 * np.sin(np.arange(N_FRAMES) / 30)[:, None, None], 4)
POSITIONS[:3, 4] = np.nan


def place(frame, name):
    values = POSITIONS[frame, NAMES.index(name)]
    return [None if np.isnan(one) else float(one) for one in values]


FRAMES = [{name: place(at, name) for name in NAMES} for at in range(N_FRAMES)]
FPS = {"fps": 30, "units": "m"}


def xyz(values, axes="xyz"):
    return dict(zip(axes, values, strict=True))


def named(frame, **more):
    return [{"name": name, **xyz(values), **more} for name, values in frame.items()]


def columns(frame, mark="_"):
    return {
        f"{name}{mark}{axis}": one
        for name, values in frame.items()
        for axis, one in xyz(values).items()
    }


def bare(frame):
    return list(frame.values())


def table(mark="_"):
    return [{"time": at / 30, **columns(one, mark)} for at, one in enumerate(FRAMES)]


LAYOUTS = {
    "a mapping of x, y, z": {**FPS, "frames": [{n: xyz(v) for n, v in f.items()} for f in FRAMES]},
    "X, Y, Z, and a list alone": [{n: xyz(v, "XYZ") for n, v in f.items()} for f in FRAMES],
    "one of them a mapping": {**FPS, "frames": [{**f, "ball": xyz(f["ball"])} for f in FRAMES]},
    "keypoints with their names": {**FPS, "frames": [{"keypoints": named(f)} for f in FRAMES]},
    "a list of keypoints a frame": [{"frame": k, "joints": named(f, score=0.9)} for k, f in enumerate(FRAMES)],
    "a position and a rotation": {**FPS, "frames": [{n: {"position": v, "rotation": [0, 0, 0, 1]} for n, v in f.items()} for f in FRAMES]},
    "position by name": {**FPS, "frames": [{"points": [{"label": n, "position": v} for n, v in f.items()]} for f in FRAMES]},
    "names once, bare frames": {**FPS, "keypoint_names": NAMES, "frames": [bare(f) for f in FRAMES]},
    "names once, keypoints": {**FPS, "names": NAMES, "keypoints": [bare(f) for f in FRAMES]},
    "names once, bare keypoints a frame": {**FPS, "joint_names": NAMES, "frames": [{"keypoints": bare(f)} for f in FRAMES]},
    "names once, flat": {**FPS, "joint_names": NAMES, "frames": [{"keypoints": list(chain.from_iterable(bare(f)))} for f in FRAMES]},
    "frames by another name": {**FPS, "poses_3d": [{"id": k, "landmark_positions": f} for k, f in enumerate(FRAMES)]},
    "bodies of a depth camera": {**FPS, "joint_names": NAMES, "frames": [{"bodies": [{"joint_positions": bare(f)}]} for f in FRAMES]},
    "nothing where nothing was seen": {**FPS, "frames": [{n: v if v[0] is not None else [] for n, v in f.items()} for f in FRAMES]},
    "frames by number": {str(at): one for at, one in reversed(list(enumerate(FRAMES)))},
    "frames by number inside": {**FPS, "frames": {str(at): one for at, one in enumerate(FRAMES)}},
    "one level deeper": {"data": {**FPS, "frames": [{"keypoints": one} for one in FRAMES]}},
    "rate and unit apart": {"metadata": FPS, "frames": [{"keypoints": one} for one in FRAMES]},
    "turned over": {**FPS, "keypoints": {n: [f[n] for f in FRAMES] for n in NAMES}},
    "turned over, no rate": {n: [f[n] for f in FRAMES] for n in NAMES},
    "turned over by axis": {**FPS, "keypoints": {n: {a: [f[n][k] for f in FRAMES] for k, a in enumerate("xyz")} for n in NAMES}},
    "turned over by column": {**FPS, **{f"{n}_{a}": [f[n][k] for f in FRAMES] for n in NAMES for k, a in enumerate("xyz")}},
    "records": table(),
    "records with points": table("."),
    "columns": {name: {str(at): row[name] for at, row in enumerate(table())} for name in table()[0]},
    "split": {"columns": list(table()[0]), "index": list(range(N_FRAMES)), "data": [list(row.values()) for row in table()]},
}  # fmt: skip


def assert_is_the_recording(found):
    assert tuple(name.removeprefix("person0:") for name in found.names) == NAMES
    np.testing.assert_allclose(found.positions, POSITIONS, atol=1e-9)
    np.testing.assert_allclose(np.diff(found.time), 1 / 30, atol=1e-6)


@CONCLUDING
@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_of_json(tmp_path, layout):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(LAYOUTS[layout]))
    assert recognise(path.read_bytes()[:16_384]).name == "keypoints JSON"
    assert_is_the_recording(read_recording(path, rate_hz=30.0))


@CONCLUDING
def test_a_frame_a_line(tmp_path):
    path = tmp_path / "a.jsonl"
    rows = [json.dumps({"frame": at, "keypoints": one}) for at, one in enumerate(FRAMES)]
    path.write_text("\n".join(rows) + "\n")
    assert_is_the_recording(read_recording(path, rate_hz=30.0))


@CONCLUDING
def test_one_list_may_be_longer_than_what_tells_the_format(tmp_path):
    path = tmp_path / "a.json"
    long = {name: [[0.1234, 0.2, 1.7 - 0.1 * k]] * 2000 for k, name in enumerate(NAMES)}
    path.write_text(json.dumps({**FPS, "keypoints": long}))
    assert read_recording(path).positions.shape == (2000, 5, 3)


@pytest.mark.parametrize(
    "content",
    [
        {"fps": 30, "labels": [{"name": "head_move", "start": 1, "end": 5}] * 3},
        {"camera": {"position": {"x": 1, "y": 2, "z": 3}, "target": {"x": 1, "y": 2, "z": 3}}},
        {"hand_to_eye": [[1, 0, 0, 0.1], [0, 1, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]},
    ],
)
def test_other_json_is_no_recording(content):
    assert recognise(json.dumps(content).encode()) is None


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        ({"nose": {"x": 1, "y": "b", "z": 3}}, r"frame 1: 'nose' is \[1, 'b', 3\]"),
        ({"nose_x": 1, "nose_y": "b", "nose_z": 3}, r"frame 1: 'nose' is \[1, 'b', 3\]"),
        ({"keypoints": [[1, 2, 3], [1, 2, 3]]}, "frame 1: 'keypoints' is .*expected three numbers"),
    ],
)
def test_what_is_no_place_is_said(tmp_path, frame, message):
    path = tmp_path / "a.json"
    path.write_text(
        json.dumps({**FPS, "frames": [{"right_hip": [1, 2, 3], "ear": [1, 2, 3], **frame}] * 3})
    )
    with pytest.raises(RecordingError, match=message):
        read_recording(path)


HEADERS = {
    "behind": (["{n}_{a}"], ","),
    "capital": (["{n} {A}"], "\t"),
    "glued": (["{n}{A}"], ","),
    "in brackets": (["{n} ({A})"], ","),
    "in brackets, glued": (["{n}({A})"], ","),
    "before": (["{a}_{n}"], ","),
    "with the unit": (["{n}_{a} (m)"], ","),
    "D-Flow": (["{n}.Pos{A}"], "\t"),
    "above": (["{n}", "{A}"], ","),
    "DeepLabCut": (["scorer", "{n}", "{a}"], ","),
    "decimal commas": (["{n}_{a}"], ";"),
}


@CONCLUDING
@pytest.mark.parametrize("header", HEADERS)
def test_headers_of_tables(tmp_path, header):
    lines, separator = HEADERS[header]
    first = {"DeepLabCut": ["scorer", "bodyparts", "coords"], "above": ["", "frame"]}
    rows = [
        [start, *(line.format(n=n, a=a, A=a.upper()) for n in NAMES for a in "xyz")]
        for line, start in zip(lines, first.get(header, ["frame"]), strict=True)
    ]
    for at in range(N_FRAMES):
        cells = ["" if np.isnan(one) else str(one) for one in POSITIONS[at].ravel()]
        comma = header == "decimal commas"
        rows.append([str(at), *(one.replace(".", ",") if comma else one for one in cells)])
    path = tmp_path / "a.csv"
    path.write_text("".join(separator.join(row) + "\n" for row in rows))
    assert recognise(path.read_bytes()).name == "keypoints CSV"
    assert_is_the_recording(read_recording(path, rate_hz=30.0))


@pytest.mark.parametrize(
    "header",
    [
        "Timestamp (us),X Axis (g),Y Axis (g),Z Axis (g)",
        "time,hand_acc_x,hand_acc_y,hand_acc_z",
        "Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s)",
        "time,nose_x,nose_y,likelihood",
        "x,y,z",
    ],
)
def test_tables_without_places(header):
    assert not is_keypoint_table(f"{header}\n1,2,3,4\n")


def test_names_stand_as_far_as_the_next_one():
    labels, n_lines = join_header([["", "Hand", "", "", "Box", "", ""], ["t", *"xyzxyz"]])
    assert (labels[:2], n_lines) == (["t", "Hand_x"], 2)
    assert find_columns(labels).places == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize("rows", [["1" * 5000], ["1" * 5000, "2", "3"]])
def test_a_key_of_thousands_of_digits_counts_no_frames(tmp_path, rows):
    """Python does not parse such a number; it is said in one line, as of any other key."""
    path = tmp_path / "keypoints.json"
    path.write_text(json.dumps(FPS | {"frames": {row: FRAMES[0] for row in rows}}))
    with pytest.raises(RecordingError, match=r"keypoints.json: ") as caught:
        read_recording(path)
    assert "\n" not in str(caught.value)


def test_a_label_longer_than_any_name_takes_no_time():
    """A header of some 100 000 blanks and underscores would take the patterns minutes."""
    long = "time" + " _" * 50_000
    axes = [f"nose_{axis}" for axis in "xyz"]
    assert find_columns([long, *axes, *(f"{long}_{axis}" for axis in "xyz")]).names == ["nose"]
    assert not is_keypoint_table(f"{long},{long},{long}\n1,2,3\n")


CLOCKS = {
    "time": 1,
    "timestamp": 1e3,
    "time_ms": 1e3,
    "t": 1e6,
    "timestamp_us": 1e6,
    "timestamp_ns": 1e9,
}


@CONCLUDING
@pytest.mark.parametrize("name", CLOCKS)
@pytest.mark.parametrize("is_table", [True, False])
def test_times_of_computers(tmp_path, name, is_table):
    path, start = tmp_path / "a", 1.7e9 if name == "timestamp_ns" else 0.0
    times = [round(CLOCKS[name] * (start + at / 30), 4) for at in range(N_FRAMES)]
    frames = [{name: time, **columns(one)} for time, one in zip(times, FRAMES, strict=True)]
    rows = [
        list(frames[0]),
        *(["" if one is None else str(one) for one in each.values()] for each in frames),
    ]
    path.write_text("\n".join(map(",".join, rows)) if is_table else json.dumps(frames))
    assert_is_the_recording(read_recording(path))


@CONCLUDING
def test_words_beside_the_places_of_a_table(tmp_path):
    path = tmp_path / "a.csv"
    rows = [["trial", "time", *columns(FRAMES[0]), "result"]]
    for at, frame in enumerate(FRAMES):
        places = ["" if one is None else str(one) for one in columns(frame).values()]
        rows.append(["T1", f"{at / 30:.6f}", *places, "made" if at > 3 else ""])
    path.write_text("".join(",".join(row) + "\n" for row in rows))
    assert_is_the_recording(read_recording(path))


def test_other_digits_in_a_column_that_nothing_is_taken_from_are_no_word(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,nose_x,nose_y,nose_z,score\n0,1,2,3,\u0663\n0.1,1,2,3,0.5\n")
    with pytest.raises(RecordingError, match="column 5: got '\u0663', expected a number"):
        read_recording(path)


SEEN = [np.nan_to_num(one).tolist() for one in POSITIONS]
AROUND = {"joint_orientations": [[1.0, 0.0, 0.0, 0.0]] * len(NAMES), "bbox": [0.0, 1.0, 2.0, 3.0]}
SCORES = {"keypoint_scores": [0.9] * len(NAMES)}
SYSTEMS = {
    "Azure Kinect": {
        "joint_names": NAMES,
        "units": "m",
        "frames": [
            {"timestamp_usec": round(1e6 * at / 30), "frame_id": at,
             "bodies": [{"body_id": 1, **AROUND, "joint_positions": one}]}
            for at, one in enumerate(SEEN)
        ],
    },
    "turned before placed": {
        "joint_names": NAMES,
        **FPS,
        "frames": [{"bodies": [{"body_id": 1, "joint_positions": one, **AROUND}]} for one in SEEN],
    },
    "mmpose": {
        "meta_info": {"keypoint_id2name": {str(at): name for at, name in enumerate(NAMES)}, **FPS},
        "instance_info": [
            {"frame_id": at, "instances": [{"keypoints": one, **SCORES}]} for at, one in enumerate(SEEN)
        ],
    },
}  # fmt: skip


@CONCLUDING
@pytest.mark.parametrize("name", SYSTEMS)
def test_what_else_is_said_of_keypoints_is_no_place(tmp_path, name):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(SYSTEMS[name]))
    found = read_recording(path)
    assert [one.rpartition(":")[2] for one in found.names] == list(NAMES)
    assert found.rate_hz == 30.0
    expected = np.where(np.isnan(POSITIONS), np.nan, POSITIONS)
    np.testing.assert_allclose(found.positions, expected)
