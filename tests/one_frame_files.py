"""Recordings of which every frame has a file of its own."""

import json
from pathlib import Path

import numpy as np

# One body of CMU Panoptic's joints19, centimetres, y down, each in the order of its layout.
_HEIGHTS = (147, 163, 91, 147, 119, 94, 92, 47, 8, 147, 120, 94, 90, 47, 8, 167, 167, 167, 167)
_SIDES = (0, 0, 0, 17, 22, 19, 8, 6, 6, -17, -26, -28, -13, -14, -12, 5, 9, -5, -9)


def panoptic_body(row: int) -> np.ndarray:
    """Return a body whose right hand moves, shape (19, 3), centimetres."""
    body = np.column_stack([_SIDES, -np.array(_HEIGHTS), np.zeros(19)]).astype(float)
    body[11] += [0.0, -20 * np.sin(row / 5), 10.0]
    return body


def write_panoptic(folder: Path, n: int, people: int = 1, start: int = 100, without=()) -> Path:
    """Write frames as CMU Panoptic does; return the folder."""
    folder.mkdir(parents=True)
    for row in (row for row in range(n) if row not in without):
        bodies = []
        for person in range(people):
            joints = np.column_stack([panoptic_body(row), np.full(19, 0.5)])
            joints[:, 0] += 90.0 * person
            bodies.append({"id": person, "joints19": joints.ravel().round(6).tolist()})
        content = {
            "version": 0.7,
            "univTime": round(53541.542 + 1000 * row / 29.97, 3),
            "fpsType": "hd_29_97",
            "bodies": bodies,
        }
        (folder / f"body3DScene_{start + row:08d}.json").write_text(json.dumps(content))
    return folder
