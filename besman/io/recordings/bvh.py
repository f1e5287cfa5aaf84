"""BVH: a skeleton and the angles of its joints; positions come by forward kinematics.

Variants seen: rotations in any order and of any number of axes; positions of the root alone, of
every joint, in place of the offset or beside it; several words on a line; frames that are fewer
than the file says; skeletons of CMU (units of 1/0.45 inch), Mixamo, Xsens, MotionBuilder (LAFAN),
Rokoko, in centimetres, inches, metres. The format knows no unit: the height of the body tells it.
Files are y-up by habit; some are z-up.

References
----------
M. Meredith, S. Maddock: Motion Capture File Formats Explained, University of Sheffield, 2001.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from besman.exceptions import RecordingError
from besman.foreign.numbers import parse_number, parse_whole_number
from besman.io.recordings.bodies import from_matrices
from besman.io.recordings.c3d_names import find_names
from besman.io.recordings.clock import whole_if_near
from besman.io.recordings.conventions import BY_HABIT
from besman.io.recordings.format import READING, Units
from besman.io.recordings.lengths import body_length
from besman.io.recordings.number_rows import ROWS_SEEN, TAKE, Cells, read_rows, see_commas
from besman.io.recordings.text_lines import TextLines, open_lines
from besman.io.warning import warn_of_file
from besman.records import FloatArray, Origin, Recording
from besman.records.frozen import hand_over
from besman.records.recordings import RATES_HZ

_CHANNEL = re.compile(r"([XYZ])(position|rotation)", re.IGNORECASE)
# Lines below MOTION in which count and time of frames stand, blank ones among them.
_MOTION_LINES = 8
_MOST_JOINTS = 2000
# A joint that moves away from its offset by less than this share of it has positions beside it.
_BESIDE = 0.2

# No length or angle is greater in any unit; the squares of what is overflow.
_FARTHEST = 1e9


@dataclass
class _Joint:
    """A joint of the skeleton; ends have no channels."""

    name: str
    parent: int
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    channels: list[str] = field(default_factory=list)
    first: int = 0


def read_bvh(path: Path, units: Units | None = None, partial: bool = False) -> Recording:
    """Read a BVH file.

    Parameters
    ----------
    path : Path
        The file.
    units : "m", "cm", "mm", "in" or "ft", optional
        What offsets and positions are in.
    partial : bool
        Take what is there of a file that was cut.

    Returns
    -------
    Recording
        Every joint with its position in metres and its orientation, in the file's frame; ends of
        the skeleton are called after their joint, ``Head_end``.

    Raises
    ------
    RecordingError
        If the file is missing, cut off or contradicts itself, or no unit makes the body one of a
        person.

    Warns
    -----
    RecordingWarning
        With the unit that the height of the body tells, and if frames are missing.
    """
    lines = open_lines(path, "a BVH recording")
    joints, at = _read_skeleton(lines, path)
    n_channels = sum(len(joint.channels) for joint in joints)
    if n_channels == 0:
        raise RecordingError(f"{path}:{at}: no joint has channels; expected at least one")
    n_frames, rate_hz, first = _read_motion_header(lines, at, path)
    cells = see_commas(Cells(b" "), lines[first : first + ROWS_SEEN])
    values = read_rows(lines, first, n_channels, cells, path, partial=partial)
    _check_values(values, path, first)
    values = _check_count(n_frames, values, path, partial)
    channels = max(joint.first + len(joint.channels) for joint in joints)
    if channels > values.shape[1]:
        raise RecordingError(
            f"{path}: got {values.shape[1]} numbers a frame; expected {channels}, one a channel"
        )
    positions, orientations = _follow(joints, values)
    length = body_length(positions, units, str(path))
    positions = positions * length.metres
    return Recording(
        time=np.arange(len(values)) / rate_hz,
        positions=hand_over(positions),
        names=find_names(
            [joint.name for joint in joints], [""] * len(joints), positions, path.name
        ),
        rate_hz=rate_hz,
        source=path.name,
        orientations=orientations,
        origin=Origin(units=length.name, units_by=length.told_by, up="y", up_by=BY_HABIT),
    )


def _read_skeleton(lines: TextLines, path: Path) -> tuple[list[_Joint], int]:
    """Read the joints, parents before children, and the index of the line that says MOTION."""
    tree = _Tree()
    for at, line in enumerate(lines):
        words = line.split()
        if not words or (at == 0 and words[0].upper() == "HIERARCHY"):
            continue
        if words[0].upper() == "MOTION":
            if tree.above or not tree.joints:
                break
            return tree.joints, at
        try:
            tree.take(words)
        except (ValueError, IndexError):
            break
    else:
        raise RecordingError(f"{path}:{len(lines)}: no line MOTION; is the file cut?")
    raise RecordingError(
        f"{path}:{at + 1}: got {line.strip()!r:.60}; expected a joint with OFFSET and CHANNELS, or "
        "MOTION below all of them"
    )


class _Tree:
    """Joints as their lines come."""

    def __init__(self) -> None:
        self.joints: list[_Joint] = []
        self.above: list[int] = []
        self.n_channels = 0

    def take(self, words: list[str]) -> None:
        """Take the words of a line; a ValueError or IndexError if it is none of a skeleton."""
        kind = words[0].upper()
        if kind in ("ROOT", "JOINT", "END"):
            self._begin(kind, words)
        elif kind == "{":
            self.above.append(len(self.joints) - 1)
        elif kind == "}":
            self.above.pop()
        elif kind == "OFFSET":
            x, y, z = (parse_number(word.replace(",", ".")) for word in words[1:4])
            if not max(abs(x), abs(y), abs(z)) <= _FARTHEST:
                raise ValueError
            self.joints[-1].offset = (x, y, z)
        elif kind == "CHANNELS":
            self.joints[-1].channels = _read_channels(words)
            self.n_channels += len(self.joints[-1].channels)
        else:
            raise ValueError

    def _begin(self, kind: str, words: list[str]) -> None:
        """Begin a joint, or an end of the skeleton."""
        parent = self.above[-1] if self.above else -1
        if len(self.joints) >= _MOST_JOINTS or (kind != "ROOT") != bool(self.above):
            raise ValueError
        opened = words[-1] == "{"
        name = " ".join(words[1:-1] if opened else words[1:])
        if kind == "END":
            name = f"{self.joints[parent].name}_end"
        self.joints.append(_Joint(name, parent, first=self.n_channels))
        if opened:
            self.above.append(len(self.joints) - 1)


def _read_channels(words: list[str]) -> list[str]:
    """Return channels as `xp` for Xposition, `xr` for Xrotation."""
    found = [_CHANNEL.fullmatch(word) for word in words[2:]]
    channels = [match[1].lower() + match[2].lower()[0] for match in found if match]
    if len(channels) != len(found) or len(found) != parse_whole_number(words[1]):
        raise ValueError
    if len(set(channels)) < len(channels):
        raise ValueError
    return channels


def _read_motion_header(lines: TextLines, at: int, path: Path) -> tuple[int, float, int]:
    """Return how many frames there should be, frames per second, and where the numbers start."""
    below = enumerate(lines[at + 1 : at + 1 + _MOTION_LINES], start=at + 1)
    head = [(row, line) for row, line in below if line.strip()]
    head += [(at + 1, ""), (at + 1, "")]
    numbers = []
    for key, (row, line) in zip(("Frames:", "Frame Time:"), head, strict=False):
        before, colon, word = line.strip().partition(":")
        try:
            if not colon or before.lower() != key[:-1].lower():
                raise ValueError
            numbers.append(parse_number(word.replace(",", ".")))
        except ValueError:
            raise RecordingError(
                f"{path}:{row + 1}: got {line.strip()!r:.60}; expected {key!r} and a "
                "number; is the file cut?"
            ) from None
    slowest, fastest = RATES_HZ
    step_s, asked_hz = numbers[1], READING.get().rate_hz
    if asked_hz is None and not 1.0 / fastest <= step_s <= 1.0 / slowest:
        raise RecordingError(
            f"{path}:{row + 1}: Frame Time is {step_s:g} s; expected {1 / fastest:g} to "
            f"{1 / slowest:g}: say the rate with --rate, in a recipe with read.rate_hz"
        )
    after = lines[row + 1 : row + 1 + _MOTION_LINES]
    first = next((k for k, line in enumerate(after, start=row + 1) if line.strip()), row + 1)
    rate_hz = asked_hz or whole_if_near(1.0 / step_s)
    return int(max(min(numbers[0], 1e9), -1.0)), rate_hz, first


def _check_values(values: FloatArray, path: Path, first: int) -> None:
    """Refuse angles that are not there: a skeleton has no gaps."""
    missing = np.argwhere(np.isnan(values))
    if missing.size:
        row, column = missing[0]
        raise RecordingError(
            f"{path}:{first + int(row) + 1}: channel {int(column) + 1} of {values.shape[1]} has no "
            "number; is the file cut?"
        )


def _check_count(said: int, values: FloatArray, path: Path, partial: bool) -> FloatArray:
    """Hold the frames against what the file says."""
    if len(values) < said and not partial:
        raise RecordingError(
            f"{path}: Frames is {said} and {len(values)} follow; is the file cut? {TAKE}"
        )
    far = np.argwhere(np.abs(values) > _FARTHEST)
    if far.size:
        frame, channel = far[0].tolist()
        raise RecordingError(
            f"{path}: frame {frame + 1}: channel {channel + 1} is {values[frame, channel]:g}; "
            f"expected at most {_FARTHEST:g}, in any unit"
        )
    if len(values) != said:
        warn_of_file(f"{path.name}: Frames is {said} and {len(values)} follow")
    return values


def _follow(joints: list[_Joint], values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return positions (T, M, 3) and quaternions (T, M, 4) of all joints in the file's frame."""
    n_frames = len(values)
    positions = np.zeros((n_frames, len(joints), 3))
    turns = np.tile(np.eye(3), (n_frames, len(joints), 1, 1))
    for index, joint in enumerate(joints):
        own = values[:, joint.first : joint.first + len(joint.channels)]
        place = _place(joint, own)
        turn = np.tile(np.eye(3), (n_frames, 1, 1))
        for column, channel in enumerate(joint.channels):
            if channel[1] == "r":
                turn = turn @ _turn(channel[0], np.radians(own[:, column]))
        if joint.parent < 0:
            positions[:, index], turns[:, index] = place, turn
        else:
            above = turns[:, joint.parent]
            positions[:, index] = positions[:, joint.parent] + (above @ place[..., None])[..., 0]
            turns[:, index] = above @ turn
    return positions, from_matrices(turns)


def _place(joint: _Joint, own: FloatArray) -> FloatArray:
    """Return where a joint is in its parent's frame, (T, 3)."""
    place = np.tile(np.array(joint.offset), (len(own), 1))
    given = {channel[0]: k for k, channel in enumerate(joint.channels) if channel[1] == "p"}
    if not given:
        return place
    moved = np.array([np.median(own[:, column]) for column in given.values()])
    size = float(np.linalg.norm(joint.offset))
    # Positions stand in place of the offset; those near 0 of a joint that has one stand beside it.
    if joint.parent >= 0 and size > 0 and float(np.linalg.norm(moved)) < _BESIDE * size:
        for axis, column in given.items():
            place[:, "xyz".index(axis)] += own[:, column]
        return place
    for axis, column in given.items():
        place[:, "xyz".index(axis)] = own[:, column]
    return place


def _turn(axis: str, angles: FloatArray) -> FloatArray:
    """Return rotation matrices (T, 3, 3) about an axis."""
    one, two = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrices = np.tile(np.eye(3), (len(angles), 1, 1))
    cosine, sine = np.cos(angles), np.sin(angles)
    matrices[:, one, one] = matrices[:, two, two] = cosine
    matrices[:, two, one], matrices[:, one, two] = sine, -sine
    return matrices
