"""What commands read about a run beside its records: goals, logs of the arm, tables, options."""

import hashlib
import json
import re
import shutil
import tempfile
from functools import cache, partial
from pathlib import Path

import numpy as np
from fuzz import binary_mutations, mutations, sense, whole_files
from fuzz.target import Target
from places import TESTS

_JOINTS = ("a", "b")
_GOALS = "box1 on table at x=0.4,y=-0.3,yaw_deg=30; box1 on shelf and box2 on table; box1 on table"
_GOALS_YAML = b"""start: ["box1 on shelf", "box2 on table at x=0.4,y=-0.3"]
goals:
  - box1 on table at x=0.4,y=0.3
  - box1 on shelf and box2 on table
"""


def _made(make):
    """Return the files that a function writes into a new folder."""
    with tempfile.TemporaryDirectory() as name:
        make(Path(name))
        return {path.name: path.read_bytes() for path in sorted(Path(name).iterdir())}


def text_of(folder, name="a.txt"):
    return (folder / name).read_bytes().decode("utf-8", "surrogateescape")


def read_goals(folder):
    from besman.planning.goals import parse_goals, parse_start
    from besman.planning.goals import read_goals as read

    start, goals = read(folder / "a.yaml")
    return start + goals, parse_goals(goals) + (parse_start(start) if start else (),)


def parse_goals(folder):
    from besman.planning.goals import parse_goals as parse

    text = text_of(folder)
    return text, parse(text)


def of_goals(folder, found):
    text, goals = found
    # Names may have any digits.
    values = re.findall(r"(?:x|y|yaw_deg)\s*=([^,;]*?)(?: and |[,;]|$)", text)
    problems = ["digits that are none"] if any(map(sense.odd_digits, values)) else []
    for one in (one for goal in goals for one in goal):
        if sense.odd_text(one.thing + one.place):
            problems.append("control characters in a name")
        values = (*(one.at or ()), one.yaw_deg or 0.0)
        if not all(abs(value) <= sense.FARTHEST_M for value in values):
            problems.append("a place out of all sense")
    return problems


def log():
    time = np.arange(25) / 50
    rows = [f"{at:.4f},{0.3 * np.sin(at):.6f},{10 * at:.4f}" for at in time]
    return {"a.csv": ("# of an arm\ntime_s,a,b_deg\n" + "\n".join(rows) + "\n").encode()}


@cache
def bag(ending, kind):
    """Return a bag: joint states with the arm's URDF beside them, or poses."""
    import ros_bags

    def make(folder):
        path = folder / f"a{ending}"
        if kind == "poses":
            ros_bags.write_poses(whole_files.sample(folder), path)
            (folder / "a.tsv").unlink()
            return
        made, start = ros_bags.Messages(ros_1=ending == ".bag"), ros_bags.EPOCH_NS
        stamps = [start + 20_000_000 * row for row in range(25)]
        angles = 0.3 * np.sin(np.arange(25)[:, None] * [0.02, 0.04])
        messages = [
            (ns, made.joints(ns, _JOINTS, row)) for ns, row in zip(stamps, angles, strict=True)
        ]
        ros_bags.write_bag(path, {"/joint_states": messages})
        shutil.copy(TESTS / "fuzz" / "arm.urdf", folder / "a.urdf")

    return _made(make)


def read_execution(folder):
    from besman.io.executions import read_execution as read

    (path,) = [path for path in folder.iterdir() if path.suffix != ".urdf"]
    return path, read(path, _JOINTS)


def of_execution(folder, found):
    path, log = found
    problems = []
    if not (np.isfinite(log.time).all() and (np.diff(log.time) > 0).all()):
        problems.append("times that do not rise")
    elif not 1 <= len(log.time) / max(np.ptp(log.time), 1e-9) <= 20_000:
        problems.append("a rate that no controller has")
    if not (np.abs(log.positions) <= 1000).all():
        problems.append("angles out of all sense")
    if path.suffix == ".csv":
        rows = [one for one in text_of(folder, path.name).split("\n") if one and one[0] != "#"][1:]
        problems += ["digits that are none"] if any(map(sense.odd_digits, rows)) else []
    return problems


def read_bag(folder):
    from besman.io.recordings.formats import read_recording

    (path,) = [path for path in folder.iterdir() if path.suffix != ".urdf"]
    return read_recording(path)


def read_touchdowns(folder):
    from besman.transfer.results_table import read_results

    return read_results(folder / "a.csv", {"a.tsv:1": 3, "b.tsv:2": 1})


def of_touchdowns(folder, found):
    problems = []
    for one in found:
        if not (np.isnan(one.outcome).all() or (np.abs(one.outcome) <= 100).all()):
            problems.append("a place that no camera sees")
    rows = text_of(folder, "a.csv").split("\n")[1:]
    cells = [cell for row in rows for cell in row.split(",")[1:4]]
    return [*problems, *["digits that are none" for cell in cells if sense.odd_digits(cell)][:1]]


@cache
def transfer_state():
    from besman.records.files import load_record
    from besman.transfer.approach import TransferConfig
    from besman.transfer.state import Suggested, TransferState, save_state

    (archive,) = load_record(TESTS / "records" / "written_by_58ea6d7" / "archive.npz")
    tries = (Suggested(1, (1.5, 0.2), (1.6, 0.1)), Suggested(0, (1.5, 0.2)))
    state = TransferState("a.tsv:1", "ab", TransferConfig(), archive, tries, "cd")
    return _made(lambda folder: save_state(folder, state))


def load_state(folder):
    from besman.transfer.state import load_state as load

    return load(folder)


def of_state(folder, state):
    problems = []
    for one in state.tries:
        if not 0 <= one.row < len(state.archive.points):
            problems.append("a try of no plan")
        if not (np.abs([*one.expected_m, *(one.outcome_m or ())]) <= 1000).all():
            problems.append("a place that no camera sees")
    if any(type(one) is not str or sense.odd_text(one) for one in (state.motion, state.key)):
        problems.append("a name that is none")
    return problems


@cache
def stored_run():
    def make(folder):
        record = whole_files.record("segments")["a.npz"]
        (folder / "a.npz").write_bytes(record)
        state = {
            "name": "x", "status": "done", "error": None, "commit": "", "stages": ["01_segment"],
            "versions": {"besman": "1"}, "machine": {"cpus": 2}, "inputs": {"a.tsv": "ab"},
            "files": {"results.json": "ab"}, "exports": {"exports": {"of": "x", "files": {}}},
        }  # fmt: skip
        about = {
            "key": "k", "method": "cut", "config": {"at": 1}, "versions": {"numpy": "2"},
            "sha256": hashlib.sha256(record).hexdigest(), "wall_s": 0.5,
            "failed": [{"item": "a", "reason": "b"}],
        }  # fmt: skip
        (folder / "run.json").write_text(json.dumps(state))
        (folder / "stage.json").write_text(json.dumps(about))
        (folder / "pipeline.yaml").write_text("name: x\nrobot: ur5\ntask: stick_throw\n")

    return _made(make)


def look_at_run(folder):
    """List, check and clean a run whose files lie loose in a folder."""
    from besman.exceptions import RunError
    from besman.pipeline.check_run import check_run
    from besman.pipeline.runs import find_removable, list_runs

    stage = folder / "runs" / "r" / "01_segment"
    stage.mkdir(parents=True)
    for name in ("run.json", "pipeline.yaml"):
        (folder / name).rename(stage.parent / name)
    (folder / "stage.json").rename(stage / "stage.json")
    (folder / "a.npz").rename(stage / "record.npz")
    listed = list_runs(folder / "runs")
    try:
        find_removable(stage.parent)
    except RunError as error:
        return listed, ([], [str(error)])
    return listed, check_run(stage.parent)


def of_run(folder, found):
    listed, (whole, faults) = found
    kinds = {"done", "failed", "running", "killed", "damaged"}
    # What the lines quote is printed without what a terminal would obey.
    is_told = all(type(one) is str for one in (*whole, *faults, *(run.error for run in listed)))
    return [] if is_told and {one.status for one in listed} <= kinds else ["a run that is none"]


def page_rows():
    rows = [[0, 12, "swing_back", "right_hand"], [12, 30, "throw", "right_hand"], [0, 30, "x", ""]]
    content = {"recording": 0, "segments": rows, "bounds": [[0, 12], [12, 30]],
               "names": {"0": "elbow", "3": "hand_top"}, "revision": ""}  # fmt: skip
    return {"a.json": json.dumps(content).encode(), "a.tsv": whole_files.named()["a.tsv"]}


@cache
def _recording(content):
    from besman.io.recordings.formats import read_recording

    with tempfile.TemporaryDirectory() as name:
        (Path(name) / "a.tsv").write_bytes(content)
        return read_recording(Path(name) / "a.tsv")


def save_page(folder):
    """Take what a page sends: names, stretches, segments to be saved."""
    from besman.annotate import server
    from besman.annotate.document import Document
    from besman.exceptions import AnnotationError
    from besman.web.loopback import Request

    recording = _recording((folder / "a.tsv").read_bytes())
    content = server._content(Request({}, (folder / "a.json").read_bytes()))
    for check, key in ((server._names, "names"), (partial(server._bounds, n_samples=40), "bounds")):
        if key in content:
            check(content[key])
    document = Document(folder / "s.json", recording)
    if "segments" not in content:
        raise AnnotationError("nothing to save")
    document.save(content["segments"], "")
    return document


def of_page(folder, document):
    segments, problems = document.segments, []
    for label in segments.labels:
        if sense.odd_text(label):
            problems.append("control characters in a label")
    bounds = np.array(segments.bounds)
    if not ((bounds >= 0).all() and (bounds <= 40).all() and (bounds[:, 0] < bounds[:, 1]).all()):
        problems.append("segments outside of the recording")
    try:
        (folder / "s.json").read_text("utf-8")
    except UnicodeDecodeError:
        problems.append("a file that is no text")
    return problems


def parse_options(folder):
    """Parse the options of `besman template`, a line each."""
    from besman.templates.contexts import parse_context, parse_names, parse_region
    from besman.templates.files import parse_settings

    context, region, *settings = (text_of(folder).split("\n") + [""])[:4]
    names = parse_names("x,y")
    given = {"method": "c_cma_es", "episodes": 300, "seed": 0}
    return (
        context + region,
        [*parse_context(context, names), *sum(parse_region(region, names).values(), ())],
        parse_settings(given, tuple(settings)),
    )


def of_options(folder, found):
    text, numbers, config = found
    problems = ["digits that are none"] if sense.odd_digits(text) else []
    problems += [] if all(abs(one) <= 1000 for one in numbers) else ["a place out of all sense"]
    return problems + sense.of_config(folder, config)


_TABLE = b"""motion,try,x_m,y_m,success,note
a.tsv:1,1,1.52,0.21,yes,
a.tsv:1,2,,,no,fell
a.tsv:1,3,,,,
b.tsv:2,1,-0.4,2.1,,"a, b"
"""
_BAGS = (
    (".mcap", "joints", 3),
    (".db3", "joints", 2),
    (".bag", "joints", 2),
    (".mcap", "poses", 2),
)

OF_RUNS = {
    "goals": Target(
        lambda: {"a.txt": _GOALS.encode()}, {"a.txt": mutations.text}, parse_goals, of_goals, 2
    ),
    "goals YAML": Target(
        lambda: {"a.yaml": _GOALS_YAML}, {"a.yaml": mutations.yaml_file}, read_goals, of_goals, 2
    ),
    "execution csv": Target(log, {"a.csv": mutations.table}, read_execution, of_execution, 3),
    **{
        f"execution {ending}": Target(
            partial(bag, ending, "joints"),
            {f"a{ending}": binary_mutations.bag},
            read_execution,
            of_execution,
            share,
        )
        for ending, kind, share in _BAGS
        if kind == "joints"
    },
    **{
        f"bag {ending} of {kind}": Target(
            partial(bag, ending, kind),
            {f"a{ending}": binary_mutations.bag}
            | ({"a.urdf": mutations.xml_file} if kind == "joints" else {}),
            read_bag,
            sense.of_recording,
            share,
        )
        for ending, kind, share in _BAGS
    },
    "touchdowns": Target(
        lambda: {"a.csv": _TABLE}, {"a.csv": mutations.table}, read_touchdowns, of_touchdowns, 2
    ),
    "transfer state": Target(
        transfer_state,
        {"state.json": mutations.json_file, "archive.npz": binary_mutations.npz},
        load_state,
        of_state,
        2,
    ),
    "run folder": Target(
        stored_run,
        {
            "run.json": mutations.json_file,
            "stage.json": mutations.json_file,
            "pipeline.yaml": mutations.yaml_file,
        },
        look_at_run,
        of_run,
        3,
    ),
    "annotation page": Target(page_rows, {"a.json": mutations.json_file}, save_page, of_page, 2),
    "template options": Target(
        lambda: {"a.txt": b"x=2.3,y=0.4\nx=0.8:1.8,y=0.2:1.2\npopulation=25\nsigma=0.5"},
        {"a.txt": mutations.text},
        parse_options,
        of_options,
        1,
    ),
}
