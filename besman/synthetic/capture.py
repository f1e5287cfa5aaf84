"""A simulated recording together with its truth."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecordingError
from besman.io.atomic_files import make_folder, write_text, written_aside
from besman.io.recordings.qtm_tsv import write_tsv
from besman.io.segments_json import ThrowEvent, segments_path, write_segments
from besman.io.segments_origin import describe_origin
from besman.records import LabelledSegments, Recording
from besman.records.layers import ACTIONS, stack_layers
from besman.synthetic.body import BodyMotion

FloatArray = npt.NDArray[np.float64]

TRUTH_SUFFIX = "_truth.json"
HANDS_SUFFIX = "_hands.npz"
GHOST = "ghost"


@dataclass(frozen=True, eq=False)
class Box:
    """A box that the person handles.

    Attributes
    ----------
    centre : array, shape (T, 3)
        Metres in the laboratory frame.
    box2lab : array, shape (T, 3, 3)
        Its axes are the columns.
    half_m : array, shape (3,)
        Half its edges.
    """

    centre: FloatArray
    box2lab: FloatArray
    half_m: FloatArray


@dataclass(frozen=True, eq=False)
class JointLog:
    """What an exoskeleton logged.

    Attributes
    ----------
    urdf : str
        Name of its description.
    bodies : mapping of str to str
        Link of each of shoulder, elbow, wrist.
    angles : mapping of array, shape (T,)
        Joint to angles, rad.
    """

    urdf: str
    bodies: Mapping[str, str]
    angles: Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class Capture:
    """What the cameras saw of a simulated person, and what really happened.

    Attributes
    ----------
    recording : Recording
        With noise; markers named as a file spells them, or unnamed trajectories.
    segments : LabelledSegments
        True segments; actions where there are two layers.
    throws : tuple of ThrowEvent
        True release and touchdown of every throw.
    layers : mapping of LabelledSegments
        Building blocks of each hand where `segments` are actions, ``right_hand`` and
        ``left_hand``.
    trajectories : tuple of str
        What each trajectory of an unnamed recording is: a canonical marker name or `GHOST`.
    body : BodyMotion or None
        True motion; its capsules are what hides markers.
    boxes : tuple of Box
        What else hides markers.
    joint_log : JointLog or None
        Of an exoskeleton; written instead of positions.
    """

    recording: Recording
    segments: LabelledSegments
    throws: tuple[ThrowEvent, ...] = ()
    layers: Mapping[str, LabelledSegments] = field(default_factory=dict)
    trajectories: tuple[str, ...] = ()
    body: BodyMotion | None = None
    boxes: tuple[Box, ...] = ()
    joint_log: JointLog | None = None

    @property
    def truth(self) -> LabelledSegments:
        """What the segments file says: all layers."""
        if not self.layers:
            return self.segments
        return stack_layers({**self.layers, ACTIONS: self.segments})


def write_capture(capture: Capture, folder: Path) -> Path:
    """Write a capture as Qualisys TSV, MVNX or joint log with its truth beside it.

    The segments file holds the true segments, of all layers, and throws. ``<stem>_truth.json``
    holds what each trajectory is, in the order of the columns; ``<stem>_hands.npz`` holds the true
    hand poses (metres, quaternion wxyz).

    Parameters
    ----------
    capture : Capture
    folder : Path
        Made if it is not there.

    Returns
    -------
    Path
        The recording written.

    Raises
    ------
    RecordingError
        If one of the files is there already or cannot be written.
    """
    path = folder / capture.recording.source
    truth, hands = truth_path(path), path.with_name(path.stem + HANDS_SUFFIX)
    for file in (path, segments_path(path), truth, hands):
        if file.exists():
            raise RecordingError(f"{file}: is there already and is not overwritten")
    make_folder(folder, kind=RecordingError)
    # The recording last: where it is, all that belongs to it is there.
    origin = describe_origin(capture.recording, whole=path.suffix == ".tsv")
    write_segments(capture.truth, segments_path(path), capture.throws or None, origin)
    if capture.trajectories:
        text = json.dumps({"trajectories": list(capture.trajectories)}, indent=1) + "\n"
        write_text(truth, text, durable=False, kind=RecordingError)
    if capture.body is not None:
        _write_hands(capture, hands)
    _write_recording(capture, path)
    return path


def truth_path(recording_path: Path) -> Path:
    """Return where the truth of a recording belongs: beside it, with a fixed ending."""
    return recording_path.with_name(recording_path.stem + TRUTH_SUFFIX)


def _write_recording(capture: Capture, path: Path) -> None:
    """Write what was recorded in the format that the file's ending tells."""
    log = capture.joint_log
    if log is not None:
        from besman.io.recordings.exoskeleton import write_joint_log

        angles = np.column_stack(list(log.angles.values()))
        time = capture.recording.time
        write_joint_log(path, time, angles, list(log.angles), log.urdf, log.bodies)
    elif path.suffix == ".mvnx":
        from besman.io.recordings.mvnx import write_mvnx

        write_mvnx(capture.recording, path)
    else:
        write_tsv(capture.recording, path)


def _write_hands(capture: Capture, path: Path) -> None:
    """Write the true hand poses, rounded to a micrometre."""
    assert capture.body is not None
    hands: dict[str, Any] = {side: np.round(pose, 6) for side, pose in capture.body.hands.items()}
    with written_aside(path, kind=RecordingError) as temporary, temporary.open("wb") as file:
        np.savez(file, time=capture.recording.time, **hands)
