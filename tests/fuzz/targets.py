"""What reads foreign files: for each kind whole files, what breaks them, what reads them.

The functions are those behind the commands. What is read is judged by `sense`, which knows nothing
of the readers.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from fuzz import mutations, sense
from places import DATA, SAMPLE, TESTS, TOP

Files = dict[str, bytes]


@dataclass(frozen=True)
class Target:
    """One kind of input.

    Attributes
    ----------
    files : function of nothing
        Whole files by name.
    broken : dict of str
        What breaks which of them.
    read : function of the folder
        What a command does with them.
    judge : function of folder and result
        Names of what is nonsense in it.
    share : int
        How often it is drawn.
    """

    files: Callable[[], Files]
    broken: dict[str, Callable[..., bytes]]
    read: Callable[[Path], Any]
    judge: Callable[[Path, Any], list[str]] = field(default=lambda folder, found: [])
    share: int = 4


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
    body[7] = body[7].replace(body[7].split("\t")[2], "null")
    return {"a.tsv": ("\n".join(lines[:at] + body) + "\n").encode()}


@cache
def unnamed() -> Files:
    dots = head(DATA / "stick_throw_unlabelled" / "subject1.tsv", 60)
    person = head(DATA / "stick_throw_calibration" / "person.tsv", 40)
    return {"a.tsv": dots.encode(), "person.tsv": person.encode()}


def _recording(folder: Path, n_rows: int = 20):
    from besman.io.recordings.formats import read_recording

    (folder / "a.tsv").write_text(head(SAMPLE / "subject1.tsv", n_rows))
    return read_recording(folder / "a.tsv")


def _made(make: Callable[[Path], None]) -> Files:
    """Return the files that a function writes into a new folder."""
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        make(Path(name))
        return {path.name: path.read_bytes() for path in sorted(Path(name).iterdir())}


@cache
def c3d() -> Files:
    from besman.io.recordings.c3d import write_c3d

    def make(folder):
        write_c3d(_recording(folder), folder / "a.c3d")
        (folder / "a.tsv").unlink()

    return _made(make)


@cache
def mvnx() -> Files:
    from dataclasses import replace

    from besman.io.recordings.mvnx import write_mvnx

    def make(folder):
        recording = _recording(folder)
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


def _yaml(path: Path) -> Files:
    return {"a.yaml": path.read_bytes()}


@cache
def pipeline(name: str) -> Files:
    return _yaml(TOP / "pipelines" / f"{name}.yaml")


@cache
def arm() -> Files:
    return {
        "robot.yaml": (TESTS / "fuzz" / "arm.yaml").read_bytes(),
        "arm.urdf": (TESTS / "fuzz" / "arm.urdf").read_bytes(),
    }


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


def read_recording(folder: Path):
    from besman.io.recordings.formats import read_recording as read

    (path,) = [path for path in folder.iterdir() if path.stem == "a"]
    return read(path)


def segment(folder: Path):
    from besman.standalone.segment_files import segment_files

    return segment_files([folder / "a.tsv"], "valley_vmci", "right_arm", None)


def label_markers(folder: Path):
    from besman.standalone.label_file import label_file

    teacher = folder / "person.tsv"
    return label_file(folder / "a.tsv", "right_arm", folder / "out.tsv", teacher, True)[0]


def read_inputs(folder: Path):
    from besman.io.segments_json import find_segments, read_throws
    from besman.stages.read.read_inputs import read_inputs as read

    inputs = read([str(folder)])
    path = find_segments(folder / "a.tsv")
    return inputs, () if path is None else read_throws(path)


def load_pipeline(folder: Path):
    from besman.pipeline.config import load_pipeline as load

    return load(folder / "a.yaml")


def load_task(folder: Path):
    from besman.simulation.tasks.kinds import load_task as load

    return load(str(folder / "a.yaml"))


def load_marker_set(folder: Path):
    from besman.person.marker_set import load_marker_set as load

    return load(str(folder / "a.yaml"))


def load_robot(folder: Path):
    from besman.robot.model import load_robot as load

    return load(folder / "robot.yaml")


def add_robot(folder: Path):
    from besman.robot.model import load_robot as load
    from besman.robot.new_robot import add_robot as add

    return load(add(folder / "arm.urdf", "hand"))


def settings(folder: Path):
    from besman.pipeline.config import load_pipeline

    text = (folder / "settings.txt").read_bytes().decode("utf-8", "surrogateescape")
    return load_pipeline(TOP / "pipelines" / "ur5_stick_throw.yaml", tuple(text.split("\n")))


def load_model(folder: Path):
    from besman.stages.recognize.model import classify_features
    from besman.stages.recognize.model_files import describe_model
    from besman.stages.recognize.model_files import load_model as load

    found = load(folder / "m.npz")
    describe_model(found)
    values = np.linspace(-1, 1, 2 * 15).reshape(2, 5, 3)
    # Warping time is compiled first, for ten seconds.
    if (found.recipe.n_points, len(found.centre)) == values.shape[1:] and found.method != "dtw":
        classify_features(found, values)
    return found


def load_record(folder: Path):
    from besman.records.files import load_record as load

    return load(folder / "a.npz")


def read_ros(folder: Path):
    from besman.io.exports import read_ros_joint_trajectory

    (path,) = folder.iterdir()
    return read_ros_joint_trajectory(path)


@cache
def ros(ending: str) -> Files:
    from besman.io.exports import ros_joint_trajectory, write_ros_joint_trajectory

    time = np.arange(4) / 10
    values = np.ones((4, 2))
    message = ros_joint_trajectory(time, values, values, values, ("a", "b"))
    return _made(lambda folder: write_ros_joint_trajectory(folder / f"a.{ending}", message))


def read_joint_csv(folder: Path):
    from besman.io.exports import read_joint_csv as read

    return *read(folder / "a.csv"), ()


@cache
def joint_csv() -> Files:
    from besman.io.exports import write_joint_csv

    time, values = np.arange(6) / 10, np.ones((6, 2))
    return _made(
        lambda folder: write_joint_csv(folder / "a.csv", time, values, values, values, ("a", "b"))
    )


_SETTINGS = (
    b"margin_s=0.3\nsegment.method=vmci\nselect.label=throw\nrefine.seed=3\nlabel.longest_gap_s=1\n"
    b"map.correct=true\nrecognize={method: dtw}"
)
_READ = {"judge": sense.of_recording}
_TASKS = ("stick_throw", "ball_throw", "grasp_box", "pull_lever", "reach")
_MARKERS = ("right_arm", "two_arms", "xsens", "exoskeleton")
_RECIPES = ("ur5_stick_throw", "rh5_two_arms", "ur10_lever", "iiwa7_grasp")

TARGETS = {
    "tsv": Target(named, {"a.tsv": mutations.table}, read_recording, share=20, **_READ),
    "tsv of EXT": Target(other_header, {"a.tsv": mutations.table}, read_recording, **_READ),
    "tsv bare": Target(without_frames, {"a.tsv": mutations.table}, read_recording, **_READ),
    "segment": Target(longer, {"a.tsv": mutations.table}, segment, sense.of_borders, 3),
    "label": Target(
        unnamed, dict.fromkeys(("a.tsv", "person.tsv"), mutations.table), label_markers, share=1
    ),
    "c3d": Target(c3d, {"a.c3d": mutations.c3d}, read_recording, share=16, **_READ),
    "mvnx": Target(mvnx, {"a.mvnx": mutations.xml_file}, read_recording, share=8, **_READ),
    "joint log": Target(
        joint_log,
        {"a.csv": mutations.table, "arm.urdf": mutations.xml_file},
        read_recording,
        share=8,
        **_READ,
    ),
    "joint csv": Target(joint_csv, {"a.csv": mutations.table}, read_joint_csv, sense.of_arrays, 1),
    "segments": Target(
        segments,
        {"a_manually_segmented.json": mutations.json_file, "a_truth.json": mutations.json_file},
        read_inputs,
        sense.of_segments,
        8,
    ),
    "marker set": Target(
        lambda: _yaml(TOP / "configs" / "markers" / "right_arm.yaml"),
        {"a.yaml": mutations.yaml_file},
        load_marker_set,
        sense.of_config,
    ),
    "robot": Target(
        arm,
        {"robot.yaml": mutations.yaml_file, "arm.urdf": mutations.xml_file},
        load_robot,
        sense.of_robot,
        8,
    ),
    "robots add": Target(
        lambda: {"arm.urdf": arm()["arm.urdf"]},
        {"arm.urdf": mutations.xml_file},
        add_robot,
        sense.of_robot,
    ),
    "settings": Target(
        lambda: {"settings.txt": _SETTINGS},
        {"settings.txt": mutations.settings},
        settings,
        sense.of_config,
        2,
    ),
    **{
        f"task {name}": Target(
            lambda name=name: _yaml(TOP / "configs" / "tasks" / f"{name}.yaml"),
            {"a.yaml": mutations.yaml_file},
            load_task,
            sense.of_config,
            1,
        )
        for name in _TASKS
    },
    **{
        f"pipeline {name}": Target(
            lambda name=name: pipeline(name),
            {"a.yaml": mutations.yaml_file},
            load_pipeline,
            sense.of_config,
            2,
        )
        for name in _RECIPES
    },
    **{
        f"model {method}": Target(
            lambda method=method: model(method),
            {"m.npz": mutations.npz, "m.json": mutations.json_file},
            load_model,
            sense.of_model,
            share,
        )
        for method, share in (("nearest_neighbour", 6), ("dtw", 2), ("hmm", 4))
    },
    **{
        f"record {path.stem}": Target(
            lambda path=path: record(path.stem),
            {"a.npz": mutations.npz},
            load_record,
            sense.of_record,
            1,
        )
        for path in sorted((TESTS / "records" / "written_by_58ea6d7").glob("*.npz"))
    },
    **{
        f"ros {ending}": Target(
            lambda ending=ending: ros(ending),
            {f"a.{ending}": mutations.json_file if ending == "json" else mutations.yaml_file},
            read_ros,
            sense.of_arrays,
            1,
        )
        for ending in ("json", "yaml")
    },
}
_DRAWN = [name for name, target in TARGETS.items() for _ in range(target.share)]


def draw(rng) -> tuple[str, Files, str]:
    """Return a target, its files with one of them broken, and which."""
    name = rng.choice(_DRAWN)
    target = TARGETS[name]
    files = dict(target.files())
    which = rng.choice(list(target.broken))
    files[which] = target.broken[which](rng, files[which])
    if which == "m.npz" and rng.random() < 0.95:
        import hashlib
        import json

        # Who makes a file up makes its checksum up too.
        about = json.loads(files["m.json"])
        about["sha256"] = hashlib.sha256(files["m.npz"]).hexdigest()
        files["m.json"] = json.dumps(about).encode()
    return name, files, which
