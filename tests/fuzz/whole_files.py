"""Whole files of every kind, made once: of the sample, of what besman ships, by its writers."""

import re
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from c3d_segments import segments_file
from places import DATA, SAMPLE, TESTS, TOP

Files = dict[str, bytes]


def head(path: Path, n_rows: int) -> str:
    """Return the first rows of a TSV as a whole file."""
    lines = path.read_text().split("\n")
    first = next(at for at, line in enumerate(lines) if line.startswith("Frame")) + 1
    text = "\n".join(lines[: first + n_rows]) + "\n"
    return re.sub(r"NO_OF_FRAMES\t\d+", f"NO_OF_FRAMES\t{n_rows}", text)


@cache
def named() -> Files:
    return {"a.tsv": head(SAMPLE / "subject1.tsv", 40).encode()}


@cache
def longer() -> Files:
    return {"a.tsv": head(SAMPLE / "subject1.tsv", 120).encode()}


@cache
def other_header() -> Files:
    text = head(SAMPLE / "subject1.tsv", 30)
    text = text.replace("FREQUENCY\t100", "FREQUENCY\tEXT").replace("DESCRIPTION\t--\n", "")
    events = "EVENT\tthrow\t12\t0.12\nTRAJECTORY_TYPES\tMeasured\n"
    return {
        "a.tsv": ("FILE_VERSION\t2.0.0\n" + text.replace("DATA_INC", events + "DATA_INC")).encode()
    }


@cache
def without_frames() -> Files:
    lines = head(SAMPLE / "subject1.tsv", 30).split("\n")
    at = next(k for k, line in enumerate(lines) if line.startswith("Frame"))
    body = [line.split("\t", 2)[2] for line in lines[at + 1 :] if line]
    body[7] = "\t".join(["null", "nan", "", *body[7].split("\t")[3:]])
    return {"a.tsv": ("\n".join(lines[:at] + body) + "\n").encode()}


@cache
def unnamed() -> Files:
    dots = head(DATA / "stick_throw_unlabelled" / "subject1.tsv", 60)
    person = head(DATA / "stick_throw_calibration" / "person.tsv", 40)
    return {"a.tsv": dots.encode(), "person.tsv": person.encode()}


def sample(folder: Path, n_rows: int = 20):

    from besman.io.recordings.formats import read_recording

    (folder / "a.tsv").write_text(head(SAMPLE / "subject1.tsv", n_rows))
    return read_recording(folder / "a.tsv")


def _made(make: Callable[[Path], None]) -> Files:
    """Return the files that a function writes into a new folder."""
    with tempfile.TemporaryDirectory() as name:
        make(Path(name))
        return {path.name: path.read_bytes() for path in sorted(Path(name).iterdir())}


@cache
def c3d() -> Files:
    from besman.io.recordings.c3d import write_c3d

    def make(folder):
        write_c3d(sample(folder), folder / "a.c3d")
        (folder / "a.tsv").unlink()

    return _made(make)


@cache
def c3d_segments() -> Files:
    return {"a.c3d": segments_file()}


@cache
def mvnx() -> Files:
    from dataclasses import replace

    from besman.io.recordings.mvnx import write_mvnx

    def make(folder):
        recording = sample(folder)
        shape = (*recording.positions.shape[:2], 4)
        turns = np.broadcast_to([1.0, 0.0, 0.0, 0.0], shape)
        write_mvnx(replace(recording, orientations=turns), folder / "a.mvnx")
        (folder / "a.tsv").unlink()

    return _made(make)


@cache
def joint_log() -> Files:
    from besman.io.recordings.exoskeleton import write_joint_log

    text = (TESTS / "fuzz" / "arm.urdf").read_text()

    def make(folder):
        (folder / "arm.urdf").write_text(text)
        time = np.arange(25) / 50
        angles = 0.3 * np.sin(time[:, None] * [1.0, 2.0])
        bodies = {"shoulder": "upper", "elbow": "fore", "wrist": "hand"}
        write_joint_log(folder / "a.csv", time, angles, ["a", "b"], "arm.urdf", bodies)

    return _made(make)


@cache
def segments() -> Files:
    return {
        "a.tsv": head(SAMPLE / "subject1.tsv", 40).encode(),
        "a_manually_segmented.json": b"""{"segments": [
{"start index": 1, "end index": 12, "label": "swing_back", "layer": "right_hand"},
{"start index": 12, "end index": 30, "label": "throw", "layer": "right_hand"},
{"start index": 1, "end index": 30, "label": "throwing", "layer": "actions"},
{"start index": 14, "end index": 20, "label": "throw_part"}],
"events": {"throws": [{"release_frame": 25, "release_time_s": 0.24, "touchdown_time_s": 0.39,
"release_m": [0.1, 0.2, 1.3], "touchdown_m": [2.0, 0.1, 0.0]}]}}""",
        "a_truth.json": b"""{"trajectories": ["back_top", "back_left", "back_right", "shoulder",
"elbow", "hand_top", "hand_left", "hand_right", "stick"]}""",
    }


def yaml_at(path: Path) -> Files:
    return {"a.yaml": path.read_bytes()}


@cache
def pipeline(name: str) -> Files:
    return yaml_at(TOP / "pipelines" / f"{name}.yaml")


@cache
def arm() -> Files:
    return {
        "robot.yaml": (TESTS / "fuzz" / "arm.yaml").read_bytes(),
        "arm.urdf": (TESTS / "fuzz" / "arm.urdf").read_bytes(),
    }


@cache
def mjcf() -> Files:
    return {"arm.xml": (TESTS / "fuzz" / "arm.xml").read_bytes()}


@cache
def landings(ending: str) -> Files:
    rows = b"recording,x_m,y_m,z_m,throw\na.tsv,2.1,0.3,0.0,1\na.tsv,2.2,0.1,0.0,2\nb.tsv,1,2,3,1\n"
    text = b"""units: m
origin_m: [0.5, 0.1, 0.0]
x_axis: [0, 1, 0]
y_axis: [-1, 0, 0]
landings: {a: [[2.1, 0.3], [2.2, 0.1]], b: [1.0, 2.0, 0.1]}
"""
    return {f"a.{ending}": rows if ending == "csv" else text}


@cache
def model(method: str) -> Files:
    from besman.stages.recognize.model import Examples, Recipe, fit_model
    from besman.stages.recognize.model_files import save_model

    rng = np.random.default_rng(0)
    labels = ("idle", "idle", "idle", "throw", "throw", "throw")
    settings = {"hmm": {"n_states": 1, "random_state": 0}, "dtw": {"band_points": 2}}
    values = rng.normal(size=(6, 5, 3)) + 3 * np.arange(6)[:, None, None]
    bounds = np.arange(12).reshape(6, 2) * 10
    recipe = Recipe(("positions",), ("hand_top",), (), 5)
    about = Examples(labels, ("a.tsv",) * 6, bounds, "ab" * 32)
    made = fit_model(values, about, recipe, method, settings.get(method, {"n_neighbors": 1}), 2.0)
    return _made(lambda folder: save_model(made, folder / "m"))


@cache
def record(name: str) -> Files:
    return {"a.npz": (TESTS / "records" / "written_by_58ea6d7" / f"{name}.npz").read_bytes()}


@cache
def ros(ending: str) -> Files:
    from besman.io.exports import ros_joint_trajectory, write_ros_joint_trajectory

    time = np.arange(4) / 10
    values = np.ones((4, 2))
    message = ros_joint_trajectory(time, values, values, values, ("a", "b"))
    return _made(lambda folder: write_ros_joint_trajectory(folder / f"a.{ending}", message))


@cache
def joint_csv() -> Files:
    from besman.io.exports import write_joint_csv

    time, values = np.arange(6) / 10, np.ones((6, 2))
    return _made(
        lambda folder: write_joint_csv(folder / "a.csv", time, values, values, values, ("a", "b"))
    )


@cache
def foreign(name: str, ending: str) -> Files:
    from foreign_recordings import WRITERS, write_keypoint_rows

    from besman.records import Recording

    time = np.arange(12) / 50
    positions = np.array([[0.0, 0.0, 1.7], [0.1, 0.2, 0.9], [0.3, 0.1, 0.1]]) + np.zeros((12, 1, 1))
    positions = positions + 0.05 * np.sin(3 * time)[:, None, None]
    if name != "BVH":
        positions[4:6, 1] = np.nan
    recording = Recording(time, positions, ("head", "hips", "foot"), 50.0, "a", 1)
    write = WRITERS.get(name, write_keypoint_rows)
    return _made(lambda folder: write(recording, folder / f"a.{ending}"))


@cache
def six_d() -> Files:
    from foreign_recordings import six_d_lines, write_lines

    from besman.records import Recording

    time = np.arange(12) / 50
    positions = np.ones((12, 2, 3)) + 0.05 * np.sin(3 * time)[:, None, None]
    turns = np.tile([0.5, 0.5, 0.5, 0.5], (12, 2, 1))
    recording = Recording(time, positions, ("hand", "back"), 50.0, "a", 1, turns)
    return _made(lambda folder: write_lines(six_d_lines(recording), folder / "a.tsv"))
