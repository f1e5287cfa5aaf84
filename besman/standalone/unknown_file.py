"""What a file looks like that is no recording besman knows."""

from __future__ import annotations

import re
from pathlib import Path

from besman.io.recordings.format import IN_PICTURES, is_keypoints
from besman.io.recordings.formats import FORMATS
from besman.io.segments_json import SEGMENTS_SUFFIX

_HEAD_BYTES = 4096
_SHOWN = 60
_SEPARATORS = {"\t": "tabs", ",": "commas", ";": "semicolons"}
# What other programs of the field write, by how its first bytes begin, and may be a recording.
_MOTIONS = (
    (rb"PK\x03\x04", "an archive (.xlsx, .zip): save its tables as CSV, or unpack it"),
    (rb"\x1f\x8b", "compressed by gzip: unpack it"),
    (rb"\x89HDF", "HDF5 (MATLAB 7.3, for one): export C3D or CSV"),
    (rb"MATLAB 5", "a MATLAB file: export C3D or CSV"),
    (rb"\x93NUMPY", "a NumPy array: write CSV with columns NAME_x, NAME_y, NAME_z"),
    (rb"\x80[\x02-\x05]", "a pickle of Python: write CSV with columns NAME_x, NAME_y, NAME_z"),
    (rb"Kaydara FBX", "FBX: export BVH"),
    (rb"SQLite format 3", "a database of SQLite, without the tables of a bag of ROS 2"),
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
# And what is none, but lies beside them.
_OTHERS = (
    (rb"\x89PNG|\xff\xd8\xff|.{4}ftyp|RIFF|GIF8|\x1aE\xdf\xa3", "a picture or a video"),
    (
        rb'\s*(\[\s*\{\s*"start index"|\{\s*"segments")',
        "segments of a recording: look at the recording; besman annotate shows both",
    ),
    (
        rb"\s*(<\?xml.*?)?(<!--.*?-->\s*)*<(robot|mujoco)\b",
        "a robot (URDF, xacro, MJCF): besman robots try FILE",
    ),
    (rb"(#[^\n]*\n|\s)*name:[^\n]*\nrecordings:", "a pipeline: besman check FILE"),
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
    ".npz": "arrays of NumPy: write CSV with columns NAME_x, NAME_y, NAME_z",
    ".trb": "a binary track file of Motion Analysis: export TRC",
}
# And what is no recording whatever it begins with: texts, pictures, programs, settings, models.
_NO_MOTIONS = {
    ".md", ".rst", ".tex", ".bib", ".pdf", ".doc", ".docx", ".odt", ".ppt", ".pptx", ".html",
    ".htm", ".css", ".js", ".ts", ".py", ".pyc", ".ipynb", ".m", ".r", ".c", ".h", ".cpp",
    ".hpp", ".so", ".dll", ".exe", ".o", ".a", ".jar", ".sh", ".bat", ".yaml", ".yml",
    ".toml", ".ini", ".cfg", ".lock", ".log", ".png", ".jpg", ".jpeg", ".gif", ".svg", ".bmp",
    ".tif", ".tiff", ".webp", ".ico", ".mp4", ".avi", ".mov", ".mkv", ".wmv", ".wav", ".mp3",
    ".urdf", ".xacro", ".mjcf", ".osim", ".stl", ".obj", ".mtl", ".dae", ".ply", ".glb",
    ".pt", ".pth", ".onnx", ".ckpt", ".ttf", ".db",
}  # fmt: skip
_MANY_NUMBERS = re.compile(rb"\[\s*(?:-?[0-9][-+.0-9eE]*\s*,\s*){5}")
_FEWEST_ROWS = 3


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
    head = _read_head(path)
    for pattern, what in (*_MOTIONS, *_OTHERS):
        if path.suffix.lower() not in _OF_PROGRAMS and _begins(head, pattern):
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


def is_like_recording(path: Path) -> bool:
    """Tell whether a file of no known format may be a recording all the same.

    Parameters
    ----------
    path : Path
        An existing file.

    Returns
    -------
    bool
        Of what only another program reads, of what is binary, and of tables and lists of numbers;
        not of texts, pictures, programs, settings, and what else lies beside recordings.
    """
    ending = path.suffix.lower()
    if ending in _OF_PROGRAMS:
        return True
    if ending in _NO_MOTIONS or path.name.endswith(SEGMENTS_SUFFIX):
        return False
    head = _read_head(path)
    if not head.strip() or any(_begins(head, pattern) for pattern, _ in _OTHERS):
        return False
    if b"\0" in head or any(_begins(head, pattern) for pattern, _ in _MOTIONS):
        return True
    if head.lstrip()[:1] in (b"{", b"["):
        return _MANY_NUMBERS.search(head) is not None or is_keypoints(head)
    lines = [line for line in head.decode("utf-8", "replace").splitlines() if line.strip()]
    return sum(map(_is_numbers, lines)) >= _FEWEST_ROWS


def _read_head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD_BYTES)


def _begins(head: bytes, pattern: bytes) -> bool:
    return re.match(pattern, head, re.DOTALL | re.MULTILINE) is not None


def _by_ending(path: Path) -> str:
    """Say what a file of this ending would be."""
    named = [one.name for one in FORMATS if path.suffix.lower() in one.suffixes]
    return f", and is not {' or '.join(named)} as its ending says" if named else ""


def _is_numbers(line: str) -> bool:
    """Tell whether a line of a table holds numbers."""
    cells = [cell for cell in re.split(r"[\t,; ]+", line.strip()) if cell]
    return len(cells) > 1 and all(re.fullmatch(r"[-+0-9.eE]+|nan|NaN", cell) for cell in cells)
