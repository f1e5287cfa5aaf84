"""What reads foreign files: for each kind whole files, what breaks them, what reads them.

The functions are those behind the commands. What is read is judged by `sense`, which knows nothing
of the readers.
"""

import importlib.util
from pathlib import Path

import numpy as np
from fuzz import binary_mutations, mutations, sense, whole_files
from fuzz.mirror_targets import BEHIND_STREAMS
from fuzz.run_targets import OF_RUNS
from fuzz.stream_targets import STREAMS
from fuzz.target import Target
from fuzz.whole_files import Files
from places import TESTS, TOP


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
    return label_file(folder / "a.tsv", "right_arm", folder / "out.tsv", teacher, True)[1]


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


def load_tool(folder: Path):
    from besman.config.yaml_file import load_config
    from besman.robot.config import ToolConfig

    return load_config(folder / "a.yaml", ToolConfig)


def add_mjcf(folder: Path):
    from besman.robot.model import load_robot as load
    from besman.robot.new_robot import add_robot as add

    return load(add(folder / "arm.xml"))


def read_landings(folder: Path):
    from besman.io.landings import read_landings as read

    (path,) = folder.iterdir()
    return read(path)


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


def read_joint_csv(folder: Path):
    from besman.io.exports import read_joint_csv as read

    return *read(folder / "a.csv"), ()


_SETTINGS = (
    b"margin_s=0.3\nsegment.method=vmci\nselect.label=throw\nrefine.seed=3\nlabel.longest_gap_s=1\n"
    b"map.correct=true\nrecognize={method: dtw}"
)
_READ = {"judge": sense.of_recording}
_FOREIGN = (
    ("TRC", "trc"),
    ("Motive CSV", "csv"),
    ("Nexus CSV", "csv"),
    ("BVH", "bvh"),
    ("keypoints JSON", "json"),
    ("keypoints CSV", "csv"),
    ("keypoint rows", "csv"),
)
_TASKS = ("stick_throw", "ball_throw", "grasp_box", "pull_lever", "reach")
_MARKERS = ("right_arm", "two_arms", "xsens", "exoskeleton")
_RECIPES = ("ur5_stick_throw", "rh5_two_arms", "ur10_lever", "iiwa7_grasp")

TARGETS = {
    "tsv": Target(whole_files.named, {"a.tsv": mutations.table}, read_recording, share=20, **_READ),
    "tsv of EXT": Target(
        whole_files.other_header, {"a.tsv": mutations.table}, read_recording, **_READ
    ),
    "tsv bare": Target(
        whole_files.without_frames, {"a.tsv": mutations.table}, read_recording, **_READ
    ),
    "segment": Target(whole_files.longer, {"a.tsv": mutations.table}, segment, sense.of_borders, 3),
    "label": Target(
        whole_files.unnamed,
        dict.fromkeys(("a.tsv", "person.tsv"), mutations.table),
        label_markers,
        share=1,
    ),
    "c3d": Target(
        whole_files.c3d, {"a.c3d": binary_mutations.c3d}, read_recording, share=16, **_READ
    ),
    "c3d of segments": Target(
        whole_files.c3d_segments,
        {"a.c3d": binary_mutations.c3d},
        read_recording,
        share=4,
        **_READ,
    ),
    "mvnx": Target(
        whole_files.mvnx, {"a.mvnx": mutations.xml_file}, read_recording, share=8, **_READ
    ),
    "joint log": Target(
        whole_files.joint_log,
        {"a.csv": mutations.table, "arm.urdf": mutations.xml_file},
        read_recording,
        share=8,
        **_READ,
    ),
    **{
        name: Target(
            lambda name=name, ending=ending: whole_files.foreign(name, ending),
            {f"a.{ending}": mutations.json_file if ending == "json" else mutations.table},
            read_recording,
            share=5,
            **_READ,
        )
        for name, ending in _FOREIGN
    },
    "tsv of bodies": Target(whole_files.six_d, {"a.tsv": mutations.table}, read_recording, **_READ),
    "joint csv": Target(
        whole_files.joint_csv, {"a.csv": mutations.table}, read_joint_csv, sense.of_arrays, 1
    ),
    "segments": Target(
        whole_files.segments,
        {"a_manually_segmented.json": mutations.json_file, "a_truth.json": mutations.json_file},
        read_inputs,
        sense.of_segments,
        8,
    ),
    "marker set": Target(
        lambda: whole_files.yaml_at(TOP / "configs" / "markers" / "right_arm.yaml"),
        {"a.yaml": mutations.yaml_file},
        load_marker_set,
        sense.of_config,
    ),
    "robot": Target(
        whole_files.arm,
        {"robot.yaml": mutations.yaml_file, "arm.urdf": mutations.xml_file},
        load_robot,
        sense.of_robot,
        8,
    ),
    "robots add": Target(
        lambda: {"arm.urdf": whole_files.arm()["arm.urdf"]},
        {"arm.urdf": mutations.xml_file},
        add_robot,
        sense.of_robot,
    ),
    "robots add MJCF": Target(
        whole_files.mjcf, {"arm.xml": mutations.xml_file}, add_mjcf, sense.of_robot
    ),
    "tool": Target(
        lambda: whole_files.yaml_at(TOP / "tools" / "gripper3.yaml"),
        {"a.yaml": mutations.yaml_file},
        load_tool,
        sense.of_tool,
        2,
    ),
    **{
        f"landings {ending}": Target(
            lambda ending=ending: whole_files.landings(ending),
            {f"a.{ending}": mutations.table if ending == "csv" else mutations.yaml_file},
            read_landings,
            sense.of_landings,
            2,
        )
        for ending in ("csv", "yaml")
    },
    "settings": Target(
        lambda: {"settings.txt": _SETTINGS},
        {"settings.txt": mutations.settings},
        settings,
        sense.of_config,
        2,
    ),
    **{
        f"task {name}": Target(
            lambda name=name: whole_files.yaml_at(TOP / "configs" / "tasks" / f"{name}.yaml"),
            {"a.yaml": mutations.yaml_file},
            load_task,
            sense.of_config,
            1,
        )
        for name in _TASKS
    },
    **{
        f"pipeline {name}": Target(
            lambda name=name: whole_files.pipeline(name),
            {"a.yaml": mutations.yaml_file},
            load_pipeline,
            sense.of_config,
            2,
        )
        for name in _RECIPES
    },
    **{
        f"model {method}": Target(
            lambda method=method: whole_files.model(method),
            {"m.npz": binary_mutations.npz, "m.json": mutations.json_file},
            load_model,
            sense.of_model,
            share,
        )
        for method, share in (("nearest_neighbour", 6), ("dtw", 2), ("hmm", 4))
        # Of an extra, which has no wheel for every Python.
        if method != "hmm" or importlib.util.find_spec("hmmlearn")
    },
    **{
        f"record {path.stem}": Target(
            lambda path=path: whole_files.record(path.stem),
            {"a.npz": binary_mutations.npz},
            load_record,
            sense.of_record,
            1,
        )
        for path in sorted((TESTS / "records" / "written_by_58ea6d7").glob("*.npz"))
    },
    **{
        f"ros {ending}": Target(
            lambda ending=ending: whole_files.ros(ending),
            {f"a.{ending}": mutations.json_file if ending == "json" else mutations.yaml_file},
            read_ros,
            sense.of_arrays,
            1,
        )
        for ending in ("json", "yaml")
    },
    **STREAMS,
    **BEHIND_STREAMS,
    **OF_RUNS,
}
_DRAWN = [name for name, target in TARGETS.items() for _ in range(target.share)]


def draw(rng, only="") -> tuple[str, Files, str]:
    """Return a target, its files with one of them broken, and which; `only`: begins of names."""
    wanted = tuple(only.split(","))
    name = rng.choice([name for name in _DRAWN if name.startswith(wanted)] if only else _DRAWN)
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
