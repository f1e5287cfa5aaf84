"""Every format, spoilt in every way there is: one line, exit 2, nothing written.

A file whose header is wrong where its rows are right may be read instead: then to the right times
and places, and with a warning.
"""

import json
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from command_line import besman
from format_samples import HAD, LOG, recording_of, write_to

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.format import reading
from besman.io.recordings.formats import read_recording

N_SAMPLES = 12
TEXT = [one for one in HAD if one.name not in ("C3D", "ROS bag")]
C3D = next(one for one in HAD if one.name == "C3D")
ROW = re.compile(r"-?[0-9.]+([\t ,][-0-9.\t ,eE]*)+")
MANY = 10_000


@pytest.fixture(scope="module")
def texts(tmp_path_factory):
    """What a file of each format holds."""
    folder = tmp_path_factory.mktemp("whole")
    found = {}
    for at, entry in enumerate(HAD):
        path = folder / f"{at}.dat"
        write_to(entry, recording_of(n_samples=N_SAMPLES), path)
        found[entry.name] = path.read_bytes()
    return found


def rows_of(lines):
    """Return which lines are rows of numbers: those behind the last line that is none."""
    last = max(at for at, line in enumerate(lines) if line.strip() and not ROW.fullmatch(line))
    return [at for at in range(last + 1, len(lines)) if lines[at].strip()]


def without_rows(name, text):
    if name == "Xsens MVNX":
        return re.sub(r"<frame [^>]*>.*</frame>\n", "", text, flags=re.DOTALL)
    if name == "keypoints JSON":
        return re.sub(r'"frames": \[.*\]', '"frames": []', text)
    lines = text.split("\n")
    return "\n".join(lines[: rows_of(lines)[0]]) + "\n"


def backwards(name, text):
    if name == "Xsens MVNX":
        frames = re.findall(r"<frame [^>]*>.*?</frame>\n", text, flags=re.DOTALL)
        return text.replace("".join(frames), "".join(reversed(frames)))
    if name == "keypoints JSON":
        content = json.loads(text)
        return json.dumps({**content, "frames": content["frames"][::-1]})
    lines = text.split("\n")
    rows = rows_of(lines)
    for at, line in zip(rows, [lines[at] for at in reversed(rows)], strict=True):
        lines[at] = line
    return "\n".join(lines)


def many_columns(name, text):
    if name == "Xsens MVNX":
        return text.replace("</position>", " 1.0" * MANY + "</position>", 1)
    if name == "keypoints JSON":
        return text.replace("]}}", ", 1.0" * MANY + "]}}", 1)
    lines = text.split("\n")
    row = rows_of(lines)[1]
    mark = next(one for one in "\t, " if one in lines[row])
    lines[row] = lines[row].rstrip() + f"{mark}1.0" * MANY
    return "\n".join(lines)


RATES = {
    "Qualisys TSV": (r"FREQUENCY\t50", "FREQUENCY\t0"),
    "Xsens MVNX": ('frameRate="50"', 'frameRate="0"'),
    "TRC": (r"\n50\t50\t", r"\n0\t0\t"),
    "Motive CSV": (r"Frame Rate,[0-9.]+", "Frame Rate,0.000000"),
    "Nexus CSV": (r"\n50\n", r"\n0\n"),
    "BVH": (r"Frame Time: [0-9.]+", "Frame Time: 0"),
    "keypoints JSON": (r'"fps": 50.0', '"fps": 0'),
    "keypoints CSV": (r"# units: m", "# fps: 0\n# units: m"),
}
COUNTS = {
    "Qualisys TSV": (r"NO_OF_MARKERS\t3", "NO_OF_MARKERS\t7"),
    "Xsens MVNX": (r'segmentCount="3"', 'segmentCount="7"'),
    "TRC": (r"\t12\t3\tmm", r"\t99\t7\tmm"),
    "Motive CSV": (r"Total Exported Frames,12", "Total Exported Frames,99"),
    "BVH": (r"Frames: 12", "Frames: 99"),
}
CASES = {
    "empty": lambda name, text: "",
    "header only": without_rows,
    "rate of zero": lambda name, text: re.sub(*RATES[name], text),
    "wrong counts": lambda name, text: re.sub(*COUNTS[name], text),
    "decreasing time": backwards,
    "10 000 columns": many_columns,
}
# What a file may say otherwise, and be read all the same.
MAY_BE_READ = {"rate of zero", "wrong counts"}
HAVE = {"rate of zero": RATES, "wrong counts": COUNTS}
# A BVH and rows without a time have no order of their own but that of their lines.
PAIRS = [
    (entry.name, case)
    for entry in TEXT
    for case in CASES
    if entry.name in HAVE.get(case, {entry.name})
    and (entry.name, case) != ("BVH", "decreasing time")
]


def look(monkeypatch, capsys, path):
    """Look at a file; return exit code and the lines of errors. Nothing may be written on error."""
    code = besman(monkeypatch, "look", path, "--json", path.with_name("look.json"))
    said = capsys.readouterr().err.splitlines()
    written = sorted(one.name for one in path.parent.iterdir())
    assert written == ([path.name] if code else sorted(["look.json", path.name]))
    return code, [line for line in said if ": error: " in line], said


def assert_refused(monkeypatch, capsys, path):
    code, errors, said = look(monkeypatch, capsys, path)
    assert (code, len(errors), len(said)) == (2, 1, 1), said
    assert path.name in errors[0]
    assert len(errors[0]) < 500


@pytest.mark.parametrize(("name", "case"), PAIRS)
def test_spoilt_text(monkeypatch, capsys, tmp_path, texts, name, case):
    path = tmp_path / "spoilt.dat"
    text = texts[name].decode()
    spoilt = CASES[case](name, text)
    assert spoilt != text
    path.write_text(spoilt)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            found = read_recording(path)
    except RecordingError:
        assert_refused(monkeypatch, capsys, path)
        return
    assert case in MAY_BE_READ
    assert any(one.category is RecordingWarning for one in caught)
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        whole = read_recording(path)
    np.testing.assert_allclose(found.time, whole.time)
    np.testing.assert_array_equal(found.positions, whole.positions)


@pytest.mark.parametrize("case", ["empty", "header only", "rate of zero", "wrong counts"])
def test_spoilt_c3d(monkeypatch, capsys, tmp_path, texts, case):
    content = bytearray(texts["C3D"])
    if case == "empty":
        content = bytearray()
    elif case == "header only":
        del content[512:]
    elif case == "rate of zero":
        # In the header and in POINT:RATE.
        content[20:24] = bytes(4)
        at = content.index(b"RATE") + len(b"RATE")
        content[at + 4 : at + 8] = bytes(4)
    else:
        content[2:4] = (900).to_bytes(2, "little")
    path = tmp_path / "spoilt.c3d"
    path.write_bytes(content)
    assert_refused(monkeypatch, capsys, path)


@pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
@pytest.mark.parametrize("entry", TEXT, ids=lambda entry: entry.name)
def test_mixed_line_ends_change_nothing(tmp_path, texts, entry):
    path = tmp_path / "mixed"
    path.write_bytes(texts[entry.name])
    whole = read_recording(path)
    lines = texts[entry.name].split(b"\n")
    path.write_bytes(b"".join(line + (b"\r\n", b"\n")[at % 2] for at, line in enumerate(lines)))
    found = read_recording(path)
    np.testing.assert_array_equal(found.positions, whole.positions)
    np.testing.assert_array_equal(found.time, whole.time)


@pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
@pytest.mark.parametrize("entry", HAD, ids=lambda entry: entry.name)
def test_a_static_trial_is_read(tmp_path, entry):
    still = recording_of(n_samples=N_SAMPLES)
    still = replace(still, positions=np.repeat(still.positions[:1], N_SAMPLES, axis=0))
    path = tmp_path / "still"
    write_to(entry, still, path)
    found = read_recording(path)
    assert np.ptp(found.positions, axis=0).max() < 1e-9
    if entry.name != LOG:
        np.testing.assert_allclose(found.positions, still.positions, atol=1e-6)


@pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
@pytest.mark.parametrize("entry", [one for one in HAD if one.name != LOG], ids=lambda e: e.name)
def test_of_two_people_one_is_taken(tmp_path, entry):
    two = recording_of(("Ann:hand_top", "Bob:hand_top", "ball"))
    path = tmp_path / "two"
    write_to(entry, two, path)
    whole = read_recording(path)
    if entry.name in ("Nexus CSV", "ROS bag"):
        return  # has subjects of its own, and frames' names; see its tests
    with reading(subject="Bob"):
        found = read_recording(path)
    assert [name.rpartition(":")[2] for name in found.names] == ["hand_top", "ball"]
    np.testing.assert_array_equal(found.positions, whole.positions[:, 1:])
