"""The kinematics of an exoskeleton: poses of the links of its URDF, for many samples at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import RecordingError, in_one_line
from besman.foreign.error_stream import catch_error_stream
from besman.foreign.urdf_text import parse_urdf
from besman.geometry.joint_axis import joint_axis
from besman.records import FloatArray


def load_exoskeleton_model(urdf: Path, path: Path) -> Any:
    """Read the kinematics of a URDF into a Pinocchio model.

    Raises
    ------
    RecordingError
        If it is no URDF; the message names the log `path` too.
    """
    try:
        text = urdf.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(
            f"{path}: {urdf.name} is not a usable URDF: {in_one_line(error)}"
        ) from None
    return parse_exoskeleton_model(text, urdf.name, path)


def parse_exoskeleton_model(text: str, called: str, path: Path) -> Any:
    """Make a Pinocchio model of the text of a URDF.

    Parameters
    ----------
    text : str
    called : str
        The URDF, for messages.
    path : Path
        The recording that it belongs to, for messages.

    Raises
    ------
    RecordingError
        If it is no URDF.
    """
    import pinocchio

    said: list[str] = []
    try:
        parse_urdf(text)
        # What is wrong is written there, not raised.
        with catch_error_stream() as said:
            return pinocchio.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        reason = in_one_line(said) or in_one_line(error)
        raise RecordingError(f"{path}: {called} is not a usable URDF: {reason}") from None


def link_poses(
    model: Any, angles: Mapping[str, FloatArray], links: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Compute the poses of links for many samples at once.

    Parameters
    ----------
    model : pinocchio.Model
        The kinematics.
    angles : mapping of str to array, shape (T,)
        Angle (rad) or offset (m) of every joint that moves one of the links.
    links : sequence of str, length M

    Returns
    -------
    rotations : array, shape (T, M, 3, 3)
        link2root.
    origins : array, shape (T, M, 3)
        Metres in the frame of the root.
    """
    n_samples = len(next(iter(angles.values())))
    poses = {0: (np.broadcast_to(np.eye(3), (n_samples, 3, 3)), np.zeros((n_samples, 3)))}

    def pose(joint: int) -> tuple[FloatArray, FloatArray]:
        if joint not in poses:
            placement = model.jointPlacements[joint]
            rotation, origin = _follow(pose(int(model.parents[joint])), placement)
            moved, turned = _move(model.joints[joint], angles[model.names[joint]])
            origin = origin + np.einsum("tij,tj->ti", rotation, moved)
            poses[joint] = (rotation @ turned, origin)
        return poses[joint]

    found = []
    for link in links:
        frame = model.frames[frame_id(model, link)]
        found.append(_follow(pose(int(frame.parentJoint)), frame.placement))
    return (
        np.stack([rotation for rotation, _ in found], axis=1),
        np.stack([origin for _, origin in found], axis=1),
    )


def _follow(parent: tuple[FloatArray, FloatArray], placement: Any) -> tuple[FloatArray, FloatArray]:
    """Go on from a moving frame by a fixed placement."""
    rotation, origin = parent
    return rotation @ placement.rotation, origin + rotation @ placement.translation


def _move(joint: Any, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the shift, shape (T, 3), and rotation, shape (T, 3, 3), of a joint of one axis."""
    from scipy.spatial.transform import Rotation

    linear, angular = joint_axis(joint)
    return values[:, None] * linear, Rotation.from_rotvec(values[:, None] * angular).as_matrix()


def frame_id(model: Any, link: str) -> int:
    """Return the index of a link among the frames of a Pinocchio model."""
    import pinocchio

    return int(model.getFrameId(link, pinocchio.FrameType.BODY))
