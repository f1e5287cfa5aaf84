"""Keypoints that stand in a list without names, in an order of their system's own.

References
----------
OpenPose, BODY_25 output format; CMU Panoptic Dataset, 3D body keypoints (``joints19``).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

# Lists of four numbers a keypoint without names: OpenPose's BODY_25 and CMU Panoptic's, in order.
_BODY_25 = (
    "Nose", "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist", "MidHip",
    "RHip", "RKnee", "RAnkle", "LHip", "LKnee", "LAnkle", "REye", "LEye", "REar", "LEar",
    "LBigToe", "LSmallToe", "LHeel", "RBigToe", "RSmallToe", "RHeel",
)  # fmt: skip
_PANOPTIC_19 = (
    "Neck", "Nose", "MidHip", "LShoulder", "LElbow", "LWrist", "LHip", "LKnee", "LAnkle",
    "RShoulder", "RElbow", "RWrist", "RHip", "RKnee", "RAnkle", "LEye", "LEar", "REye", "REar",
)  # fmt: skip
ORDERS = {"pose_keypoints_3d": _BODY_25, "joints19": _PANOPTIC_19}
"""Names of the keypoints of a list, in their order, by the key of the list."""

UNSEEN = [None, None, None]
"""The place of what was not seen."""


def is_number(value: Any) -> bool:
    """Tell whether a value of JSON is a number."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def unfold(key: str, values: list[Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield the keypoints of a list: x, y, z and how sure it is, 0 or less if not seen.

    Parameters
    ----------
    key : str
        Of `ORDERS`.
    values : list
        Four numbers a keypoint; another list is yielded as it is, under its key.
    prefix : str
        Stands before each name.
    """
    names = ORDERS[key]
    if len(values) != 4 * len(names) or not all(map(is_number, values)):
        if values:
            yield f"{prefix}{key}", values
        return
    for at, name in enumerate(names):
        *place, sure = values[4 * at : 4 * at + 4]
        yield f"{prefix}{name}", place if sure > 0 else UNSEEN
