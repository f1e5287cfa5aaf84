"""What a file looks like that is no recording besman knows."""

from __future__ import annotations

import re
from pathlib import Path

from besman.io.recordings.format import IN_PICTURES
from besman.io.recordings.formats import FORMATS

_HEAD_BYTES = 4096
_SHOWN = 60
_SEPARATORS = {"\t": "tabs", ",": "commas", ";": "semicolons"}
# What other programs of the field write, by how its first bytes begin.
_OTHERS = (
    (rb"PK\x03\x04", "an archive (.xlsx, .zip): save its tables as CSV, or unpack it"),
    (rb"\x1f\x8b", "compressed by gzip: unpack it"),
    (rb"\x89HDF", "HDF5 (MATLAB 7.3, for one): export C3D or CSV"),
    (rb"MATLAB 5", "a MATLAB file: export C3D or CSV"),
    (rb"\x93NUMPY", "a NumPy array: write CSV with columns NAME_x, NAME_y, NAME_z"),
    (rb"Kaydara FBX", "FBX: export BVH"),
    (rb"\x89PNG|\xff\xd8\xff|.{4}ftyp|RIFF", "a picture or a video"),
    (rb"SQLite format 3", "a database of SQLite, without the tables of a bag of ROS 2"),
    (
        rb'\s*(\[\s*\{\s*"start index"|\{\s*"segments")',
        "segments of a recording: look at the recording; besman annotate shows both",
    ),
    (
        rb"\s*(<\?xml.*?)?(<!--.*?-->\s*)*<(robot|mujoco)\b",
        "a robot (URDF, xacro, MJCF): besman robots try FILE",
    ),
    (rb"(#[^\n]*\n|\s)*name:[^\n]*\nrecordings:", "a pipeline: besman check FILE"),
    (
        rb'\s*\{.{0,200}"people"\s*:|\s*[{\[].{0,3000}(' + IN_PICTURES.pattern + rb")",
        "points in a picture (OpenPose, COCO), not in space: give what was triangulated from two "
        "cameras or more, for one a TRC of Pose2Sim",
    ),
    (
        rb"(?i)[^\0]{0,3000}^\s*endheader\s*$",
        "OpenSim's angles or forces (.mot, .sto), without positions: give the TRC they are from",
    ),
    (rb"(#[^\n]*\n)*:(FULLY|DEGREES)", "Acclaim's motion (AMC), angles of an ASF: convert to BVH"),
)
# And by how its name ends: what only the maker's own program reads.
_OF_PROGRAMS = {
    ".tak": "a take of Motive: export CSV or C3D there",
    ".qtm": "a measurement of Qualisys Track Manager: export TSV or C3D there",
    ".mvn": "a session of Xsens MVN: export MVNX there",
    ".x1d": "camera data of Vicon: reconstruct, then export C3D or CSV",
    ".x2d": "camera data of Vicon: reconstruct, then export C3D or CSV",
    ".vc": "camera data of Motion Analysis: track, then export TRC",
    ".cap": "tracked data of Motion Analysis: export TRC",
    ".trb": "a binary track file of Motion Analysis: export TRC",
}


def describe_unknown(path: Path) -> str:
    """Say what a file looks like whose format is not known, and what would make it one.

    Parameters
    ----------
    path : Path
        An existing file.

    Returns
    -------
    str
        One or two sentences.
    """
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    for pattern, what in _OTHERS:
        if re.match(pattern, head, re.DOTALL | re.MULTILINE):
            return f"it looks like {what}"
    if path.suffix.lower() in _OF_PROGRAMS:
        return f"by its ending it is {_OF_PROGRAMS[path.suffix.lower()]}"
    if b"\0" in head and head[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        return f"it is binary, begins with {head[:8].hex(' ')}{_by_ending(path)}"
    lines = [line for line in head.decode("utf-8", "replace").splitlines() if line.strip()]
    first = lines[0].strip() if lines else ""
    shown = first[:_SHOWN] + ("..." if len(first) > _SHOWN else "")
    numbers = next((line for line in lines if _is_numbers(line)), "")
    counts = {word: numbers.count(mark) for mark, word in _SEPARATORS.items()}
    word = max(counts, key=lambda one: counts[one])
    table = f", {counts[word] + 1} columns between {word}" if counts[word] else ""
    return (
        f"it is text{table}, begins with {shown!r}{_by_ending(path)}; a table is read whose "
        "columns are called time, NAME_x, NAME_y, NAME_z, ... in a .csv"
    )


def _by_ending(path: Path) -> str:
    """Say what a file of this ending would be."""
    named = [one.name for one in FORMATS if path.suffix.lower() in one.suffixes]
    return f", and is not {' or '.join(named)} as its ending says" if named else ""


def _is_numbers(line: str) -> bool:
    """Tell whether a line of a table holds numbers."""
    cells = [cell for cell in re.split(r"[\t,; ]+", line.strip()) if cell]
    return len(cells) > 1 and all(re.fullmatch(r"[-+0-9.eE]+|nan|NaN", cell) for cell in cells)
