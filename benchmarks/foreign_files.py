"""Files of other systems: how many are read, and how many of them as another reader reads them.

    python benchmarks/foreign_files.py FOLDER...

Every file in the folders, and in those below, that ends as a recording does. The other reader is
ezc3d for C3D (in a process of its own, for it may crash), Python's ``float`` on the cells of TRC,
Motive CSV, Nexus CSV and Qualisys TSV, and forward kinematics with SciPy for BVH. Names are held
against each other where both have them; places to 0.5 um by their distances from the first one
that is seen, which no turn to z up changes. What is 0, 0, 0 counts as not seen.
"""

from __future__ import annotations

import csv
import pickle
import re
import subprocess
import sys
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from besman.exceptions import BesmanError
from besman.io.recordings.formats import FORMATS, read_recording

NEAR_M = 5e-7
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048, "mete": 1.0}
UNITS["1/0.45 in"] = 0.0254 / 0.45
ENDINGS = {suffix for one in FORMATS for suffix in one.suffixes} | {".txt"}
BY_EZC3D = """
import ezc3d, pickle, sys
found = ezc3d.c3d(sys.argv[1])
point = found["parameters"]["POINT"]
labels = [one for key in point if key.startswith("LABELS") for one in point[key]["value"]]
units = point.get("UNITS", {"value": [""]})["value"]
pickle.dump((labels, found["data"]["points"][:3].transpose(2, 1, 0), units), sys.stdout.buffer)
"""
Peer = tuple[list[str], np.ndarray, str]


def by_ezc3d(path: Path) -> Peer | None:
    done = subprocess.run([sys.executable, "-c", BY_EZC3D, str(path)], capture_output=True)
    if done.returncode:
        return None
    labels, points, units = pickle.loads(done.stdout)
    return labels[: points.shape[1]], points, (units or [""])[0]


def number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan


def by_cells(names_at: Callable[[list[list[str]]], tuple[int, int, int, str]]) -> Callable:
    """Read a table: where its names are, its rows and its first column of places, and the unit."""

    def read(path: Path) -> Peer | None:
        text = path.read_text("utf-8-sig", errors="replace")
        mark = "\t" if path.suffix.lower() in (".trc", ".tsv") and "\t" in text else ","
        lines = [row or [""] for row in csv.reader(text.splitlines(), delimiter=mark)]
        names_row, first_row, column, unit = names_at(lines)
        names = [one for one in lines[names_row][column:] if one.strip()]
        rows = []
        for row in lines[first_row:]:
            if not any(row):
                break
            cells = [number(one) for one in row[column:]]
            rows.append((cells + [np.nan] * (3 * len(names)))[: 3 * len(names)])
        return names, np.array(rows).reshape(len(rows), -1, 3), unit

    return read


def trc_rows(lines: list[list[str]]) -> tuple[int, int, int, str]:
    names = next(at for at, row in enumerate(lines) if row[0].startswith("Frame"))
    after = range(names + 2, len(lines))
    return names, next(at for at in after if lines[at][0].strip()), 2, lines[2][4].strip()


def nexus_rows(lines: list[list[str]]) -> tuple[int, int, int, str]:
    title = next(at for at, row in enumerate(lines) if row[0].lower().startswith("traj"))
    return title + 2, title + 5, 2, lines[title + 4][2]


def tsv_rows(lines: list[list[str]]) -> tuple[int, int, int, str]:
    names = next(at for at, row in enumerate(lines) if row[0] == "MARKER_NAMES")
    after = range(names + 1, len(lines))
    first = next(at for at in after if re.match(r"-?[0-9]", lines[at][0]))
    has_frames = lines[first - 1][0] == "Frame"
    # Names stand one a column, so that each is taken for three.
    return names, first, 2 if has_frames else 0, "mm"


def by_tsv(path: Path) -> Peer | None:
    lines = [line.split("\t") for line in path.read_text("utf-8-sig", "replace").splitlines()]
    names_row, first, column, unit = tsv_rows(lines)
    names = [one.strip() for one in lines[names_row][1:] if one.strip()]
    rows = [[number(one) for one in row] for row in lines[first:] if len(row) > 3]
    width = 3 * len(names)
    values = np.array([row[column : column + width] for row in rows])
    return names, values.reshape(len(values), -1, 3), unit


def by_scipy(path: Path) -> Peer | None:
    """Follow the joints of a BVH, one after the other."""
    words = path.read_text("utf-8-sig", "replace").replace("{", " { ").replace("}", " } ").split()
    start = words.index("MOTION")
    channels = sum(int(words[at + 1]) for at in range(start) if words[at] == "CHANNELS")
    values = np.array(words[start + 6 :], float).reshape(-1, channels)
    above: list[Any] = []
    names, places, turns, at, used = [], [], [], 0, 0
    joint: dict[str, Any] = {}
    while at < start:
        word = words[at]
        if word in ("ROOT", "JOINT", "End"):
            stop = words.index("{", at)
            called = " ".join(words[at + 1 : stop])
            joint = {"name": f"{names[above[-1]]}_end" if word == "End" else called,
                     "parent": above[-1] if above else None, "channels": []}  # fmt: skip
            at = stop - 1
        elif word == "OFFSET":
            joint["offset"] = np.array(words[at + 1 : at + 4], float)
            at += 3
            if words[at + 1] != "CHANNELS":
                used = follow(joint, values, used, names, places, turns)
        elif word == "CHANNELS":
            count = int(words[at + 1])
            joint["channels"] = words[at + 2 : at + 2 + count]
            at += 1 + count
            used = follow(joint, values, used, names, places, turns)
        elif word == "{":
            above.append(len(names))
        elif word == "}":
            above.pop()
        at += 1
    return names, np.stack(places, axis=1), ""


def follow(joint, values, used, names, places, turns) -> int:
    shift = np.tile(joint["offset"], (len(values), 1))
    turn = Rotation.identity(len(values))
    for channel in joint["channels"]:
        column, used = values[:, used], used + 1
        axis = "xyz".index(channel[0].lower())
        if "pos" in channel.lower():
            shift[:, axis] = column
        else:
            turn = turn * Rotation.from_euler("xyz"[axis], column[:, None], degrees=True)
    parent = joint["parent"]
    names.append(joint["name"])
    places.append(shift if parent is None else places[parent] + turns[parent].apply(shift))
    turns.append(turn if parent is None else turns[parent] * turn)
    return used


PEERS: dict[str, Callable[[Path], Peer | None]] = {
    "C3D": by_ezc3d,
    "TRC": by_cells(trc_rows),
    "Nexus CSV": by_cells(nexus_rows),
    "Qualisys TSV": by_tsv,
    "BVH": by_scipy,
}


def distances(positions: np.ndarray) -> np.ndarray:
    """Return how far each place is from the first that is seen; NaN of what is not seen."""
    seen = np.isfinite(positions).all(axis=2) & positions.any(axis=2)
    if not seen.any():
        return np.full(seen.shape, np.nan)
    from_first = np.linalg.norm(positions - positions[tuple(np.argwhere(seen)[0])], axis=2)
    return np.where(seen, from_first, np.nan)


def compare(recording: Any, peer: Peer) -> str:
    """Say how a recording and what another reader found differ; nothing if they do not."""
    names, places, unit = peer
    scale = UNITS.get(unit.lower()) or UNITS[recording.origin.units]
    bare = [name.strip().rpartition(":")[2] for name in names]
    columns, mine = [], []
    for at, name in enumerate(recording.names):
        known = None if name is None else name.rpartition(":")[2]
        if known is not None and bare.count(known) == 1:
            columns.append(bare.index(known))
            mine.append(at)
    if not mine and len(names) == len(recording.names):
        # C3D whose whole names are descriptions.
        mine = columns = list(range(len(names)))
    if not mine:
        return "no name in common"
    found, other = (
        distances(one) for one in (recording.positions[:, mine], scale * places[:, columns])
    )
    if len(found) != len(other):
        return f"{len(found)} frames, {len(other)} by the other"
    off = np.abs(found - other)
    one_sided = int((np.isnan(found) != np.isnan(other)).sum())
    if np.nanmax(off, initial=0.0) > NEAR_M:
        return f"{np.nanmax(off) * 1e6:.3g} um apart"
    return f"{one_sided} places seen by one alone" if one_sided else ""


def try_file(path: Path) -> tuple[str, str]:
    """Return what became of a file, and what is to be said of it."""
    try:
        recording = read_recording(path)
    except BesmanError as error:
        said = str(error).replace(str(path), path.name)[:160]
        # Tables, JSON and text of all kinds lie beside recordings.
        return ("no recording", "") if "a format that is not known" in said else ("refused", said)
    peer_of = PEERS.get(recording.origin.format)
    try:
        peer = None if peer_of is None else peer_of(path)
    except Exception as error:  # what a peer cannot read is no fault of a file
        return f"{recording.origin.format}: read, no other reader", f"{path.name}: {error!r:.80}"
    if peer is None:
        return f"{recording.origin.format}: read, no other reader", ""
    said = compare(recording, peer)
    result = "read otherwise" if said else "equal"
    return f"{recording.origin.format}: {result}", f"{path.name}: {said}" if said else ""


def main() -> None:
    if len(sys.argv) < 2:
        print("files of other systems: only on real ones, name their FOLDER")
        return
    warnings.simplefilter("ignore")
    counts: Counter[str] = Counter()
    paths = [path for one in sys.argv[1:] for path in sorted(Path(one).rglob("*"))]
    for path in paths:
        if path.is_file() and path.suffix.lower() in ENDINGS:
            what, said = try_file(path)
            counts[what] += 1
            if said:
                print(f"  {what}: {said}")
    for what, count in sorted(counts.items()):
        print(f"{what:40}{count:5}")


if __name__ == "__main__":
    main()
