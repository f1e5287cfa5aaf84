"""What no recording, model or config can be: looked for in what was read, and in the file itself.

Nothing here comes from besman: a reader's own limits must not judge themselves.
"""

import dataclasses
import re
import unicodedata

import numpy as np

FARTHEST_M = 1000.0
FASTEST_M_S = 340.0
GREATEST = 1e9
_ODD_NUMBER = re.compile(r"\d_\d")


def odd_text(text):
    """Tell whether a text would move a terminal's cursor, or is longer than any name."""
    return len(text) > 5000 or any(unicodedata.category(one) in ("Cc", "Cs") for one in text)


def odd_digits(text):
    return bool(_ODD_NUMBER.search(text)) or any(
        one.isnumeric() and not one.isascii() for one in text
    )


def of_recording(folder, recording):
    found = []
    seen = recording.positions[np.isfinite(recording.positions)]
    if np.isinf(recording.positions).any() or (np.abs(seen) > FARTHEST_M).any():
        found.append("coordinates beyond 1 km")
    with np.errstate(all="ignore"):
        step = np.linalg.norm(np.diff(recording.positions, axis=0), axis=2)
        if (step * recording.rate_hz > FASTEST_M_S).any():
            found.append("faster than sound")
    found += _of_time(recording)
    names = [name for name in recording.names if name is not None]
    if any(odd_text(name) for name in names):
        found.append("control characters in a name")
    found += _of_names(names)
    found += [] if recording.orientations is None else _of_turns(recording.orientations)
    (path,) = [one for one in folder.iterdir() if one.stem == "a" and one.suffix != ".urdf"]
    if path.suffix in (".tsv", ".csv", ".mvnx"):
        found += _of_text(path, recording)
    return found


def _of_names(names):
    given = [name for name in names if name is not None]
    is_odd = len(set(given)) < len(given) or not all(name.strip() for name in given)
    return ["names twice or empty"] if is_odd else []


def _of_turns(orientations):
    turns = orientations[np.isfinite(orientations).all(axis=2)]
    is_odd = (np.abs(np.linalg.norm(turns, axis=1) - 1) > 0.01).any()
    return ["orientations that are none"] if is_odd else []


def _of_time(recording):
    rate_hz, time = recording.rate_hz, recording.time
    if not 1 <= rate_hz <= 10_000:
        return [f"a rate of {rate_hz:g} Hz"]
    if not np.isfinite(time).all() or np.abs(time).max() > GREATEST:
        return ["times that are none"]
    steps = np.diff(time) * rate_hz
    if not ((steps > 0) & (np.abs(steps - 1) < 0.6)).all():
        return ["times that do not fit the rate"]
    if not 0 <= recording.first_frame <= 1e9:
        return ["a frame number that no camera counts to"]
    return []


def _of_text(path, recording):
    found = []
    content = path.read_bytes()
    text = content.decode("utf-8", "replace")
    if path.suffix == ".tsv":
        lines = text.replace("\r", "").split("\n")
        keys = {line.split("\t")[0]: line.split("\t")[1:2] for line in reversed(lines[:14])}
        counts = [
            (keys.get(key) or [""])[0] for key in ("NO_OF_MARKERS", "NO_OF_FRAMES", "FREQUENCY")
        ]
        n_rows = len(recording.time)
        rows = [line for line in lines if line][-n_rows:]
        if any(odd_digits(one) for one in (*counts, *rows)):
            found.append("digits that are none")
        declared = counts[1].strip()
        if declared.isascii() and declared.isdigit():
            # What begins later may be a part of a take, of which all frames are counted.
            if recording.first_frame == 1 and declared.lstrip("0") != str(n_rows):
                found.append("NO_OF_FRAMES that differs")
            elif len(declared) < 10 and int(declared) < n_rows:
                found.append("more frames than NO_OF_FRAMES")
    elif path.suffix == ".csv":
        # Above the numbers stand names, which may have any digits.
        rows = [line for line in text.split("\n") if line and line[0] != "#"][1:]
        rows = rows[-len(recording.time) :]
        if any(odd_digits(row) for row in rows):
            found.append("digits that are none")
    else:
        values = re.findall(r">([^<>a-zA-Z]+)<", text) + re.findall(
            r'(?:Rate|index)="([^"]*)"', text
        )
        if any(odd_digits(value) for value in values):
            found.append("digits that are none")
    return found


def of_borders(folder, found):
    values = np.array([one["borders_s"] for one in found], dtype=float)
    if not np.isfinite(values).all() or values.max() > GREATEST:
        return ["borders that are no times"]
    return []


def of_segments(folder, found):
    inputs, throws = found
    problems = []
    for truth, recording in zip(inputs.truth, inputs.recordings, strict=True):
        if truth is None:
            continue
        layers = truth.layers or ("",) * len(truth.labels)
        rows = list(zip(map(tuple, truth.bounds.tolist()), layers, strict=True))
        if len(set(rows)) < len(rows):
            problems.append("the same stretch twice")
        if any(odd_text(label) for label in (*truth.labels, *layers)):
            problems.append("control characters in a label")
        if len(rows) and (truth.bounds.min() < 0 or truth.bounds.max() > len(recording.time)):
            problems.append("segments outside the recording")
    for names in inputs.names:
        if names is not None and any(odd_text(name) for name in names):
            problems.append("control characters in a name")
    for throw in throws:
        values = dataclasses.asdict(throw)
        # Frames are counted, by a fast camera to more than a million.
        frame = values.pop("release_frame")
        if type(frame) is not int or not 0 <= frame <= 1e9:
            problems.append("a throw at no frame")
        if not 0 < throw.touchdown_time_s - throw.release_time_s <= 60:
            problems.append("a flight out of all sense")
        flat = [*values.pop("release_m"), *values.pop("touchdown_m"), *values.values()]
        if not all(type(one) in (int, float) and abs(one) < 1e6 for one in flat):
            problems.append("a throw that is none")
    return problems


def of_config(folder, config):
    problems = set()

    def look(value):
        if isinstance(value, bool) or value is None:
            return
        if isinstance(value, int | float):
            if not abs(value) <= GREATEST:
                problems.add("a number out of all sense")
        elif isinstance(value, str):
            if odd_text(value):
                problems.add("control characters in a text")
        elif isinstance(value, dict):
            for key, inner in value.items():
                look(key)
                look(inner)
        else:
            for inner in value:
                look(inner)

    look(config.model_dump())
    return sorted(problems)


def of_tool(folder, tool):
    problems = of_config(folder, tool)
    for turn in (tool.rotation_wxyz, tool.hand_to_tcp_wxyz):
        problems += _of_turns(np.array([[turn]]))
    lengths = np.abs([tool.translation_m, tool.hand_to_tcp_m, *tool.capsule_ends_m])
    if not (lengths <= 100).all() or not 0 <= tool.capsule_radius_m <= 10:
        problems.append("lengths out of all sense")
    if not 0 <= tool.mass_kg <= 1e4:
        problems.append("masses out of all sense")
    return problems


def of_landings(folder, landings):
    problems = []
    for one in landings:
        if not (np.abs(np.array(one.place)) <= FARTHEST_M).all():
            problems.append("a place that no camera sees")
        if odd_text(one.recording) or not one.recording.strip():
            problems.append("control characters in a name, or none")
    return problems


def of_robot(folder, robot):
    problems = []
    limits = robot.limits
    ends = np.abs([limits.position_min, limits.position_max])
    if not (ends <= 1000).all():
        problems.append("limits beyond 1000 rad")
    # A jerk that nobody states is not limited.
    stated = limits.velocity, limits.acceleration, limits.torque, limits.jerk[limits.jerk < np.inf]
    if not all((one > 0).all() and (one <= 1e6).all() for one in stated):
        problems.append("limits out of all sense")
    masses = [inertia.mass for inertia in robot.model.inertias]
    if not all(0 <= mass <= 1e4 for mass in masses):
        problems.append("masses out of all sense")
    inertias = np.abs([inertia.inertia for inertia in robot.model.inertias])
    if not (inertias <= 1e6).all():
        problems.append("inertias out of all sense")
    radii = robot.chain.capsule_radii
    if not ((radii > 0) & (radii <= 10)).all():
        problems.append("radii out of all sense")
    chain = robot.chain
    lengths = (chain.placements, chain.tip, chain.capsule_ends, robot.tool.tcp2hand)
    if not all((np.abs(one) <= 300).all() for one in lengths):
        problems.append("lengths out of all sense")
    if not 0 <= robot.base_height <= 100:
        problems.append("a height out of all sense")
    names = (robot.name, robot.tool.name, *robot.joint_names, *chain.capsule_links)
    if any(odd_text(name) or name[:1] in "=+-@" for name in names):
        problems.append("names that a table or terminal would obey")
    return problems


def of_model(folder, model):
    problems = of_record(folder, model)
    if not (model.spread > 0).all():
        problems.append("a spread of nothing")
    if np.isnan(model.threshold) or model.threshold < 0:
        problems.append("a threshold that is none")
    if len(model.sources) != len(model.labels) or len(model.bounds) != len(model.labels):
        problems.append("examples without a source")
    if (model.bounds[:, 0] >= model.bounds[:, 1]).any() or (model.bounds < 0).any():
        problems.append("bounds that are none")
    if not all(np.isfinite(one).all() for one in model.parameters.values()):
        problems.append("parameters that are no numbers")
    return problems


_FINITE = {
    "weights",
    "start",
    "goal",
    "velocities",
    "accelerations",
    "examples",
    "centre",
    "spread",
}
_NAMED = ("Recording", "LabelledRecording", "MotionPlan", "CartesianPlan", "JointTrajectory")
_PLAIN = {"str": (str,), "int": (int,), "float": (float, int), "bool": (bool,)}


def of_record(folder, record):
    problems = set()

    def look(value, is_field=False):
        if isinstance(value, tuple | list):
            for item in value:
                look(item, is_field)
        elif isinstance(value, str):
            # What is outside of every record is no name.
            if is_field and odd_text(value):
                problems.add("control characters in a text")
        elif dataclasses.is_dataclass(value):
            for one in dataclasses.fields(value):
                held = getattr(value, one.name)
                look_at_field(type(value).__name__, one, held)
                look(held, one.name not in ("reason", "failure"))

    def look_at_field(kind, one, held):
        allowed = _PLAIN.get(str(one.type))
        if allowed is not None and (
            not isinstance(held, allowed) or type(held) is bool not in allowed
        ):
            problems.add(f"{one.name} of another type")
        if str(one.type).startswith("tuple[str") and not (
            isinstance(held, tuple) and all(isinstance(item, str | None) for item in held)
        ):
            problems.add(f"{one.name} of another type")
        if one.name in ("names", "markers", "joint_names") and kind in _NAMED:
            problems.update(_of_names(held))
        if not isinstance(held, np.ndarray):
            if "Array" in str(one.type) and held is not None:
                problems.add(f"{one.name} is no array")
            return
        if held.dtype.kind not in "fib":
            problems.add(f"{one.name} is no numbers")
        elif one.name in _FINITE and not (np.isfinite(held) & (np.abs(held) < 1e12)).all():
            problems.add(f"{one.name} is not finite")
        elif np.isinf(held).any():
            problems.add(f"{one.name} is infinite")
        if one.name == "orientations":
            problems.update(_of_turns(held))
        if one.name == "time" and not (np.diff(held) > 0).all():
            problems.add("times that do not rise")
        if one.name == "positions" and kind.endswith("Recording"):
            far = np.abs(held[np.isfinite(held)]) > FARTHEST_M
            problems.update(["coordinates beyond 1 km"] if far.any() else [])

    look(record)
    return sorted(problems)


def of_arrays(folder, found):
    *arrays, names = found
    problems = []
    if not all((np.isfinite(one) & (np.abs(one) < GREATEST)).all() for one in arrays):
        problems.append("numbers out of all sense")
    if any(odd_text(name) for name in names):
        problems.append("control characters in a name")
    return problems
