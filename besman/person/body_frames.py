"""Base and hand of a robot arm that was led by hand: its links stand for a person's body.

The result is the markers that a person with clusters wears, so that every stage sees these: the
base stands where the back is, the tool where the hand is.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt
from pydantic import Field

from besman.config.stage import Config
from besman.geometry.frames import quaternion_to_rotation
from besman.person.point_frames import DerivedMarkers

FloatArray = npt.NDArray[np.float64]

_PARTS = ("top", "left", "right")
# Around the base's origin and the hand's, in axes x forward, y left, z up, metres; their means are
# the origins, which is where frames are measured from.
_ON_BASE_M = np.array([[0.0, 0.0, 0.1], [0.0, 0.1, -0.05], [0.0, -0.1, -0.05]])
_ON_HAND_M = np.array([[0.06, 0.0, 0.0], [-0.03, 0.03, 0.0], [-0.03, -0.03, 0.0]])
_SMALLEST_NORM = 0.5


class BodyFrames(Config):
    """Which bodies are base and hand of an arm; they have to come with their orientation.

    Attributes
    ----------
    base : str
        Marker of the body that does not move, x ahead, y to the left, z up.
    shoulder, elbow : str
        Markers of the bodies that stand for them.
    hand : str
        Marker of the body that the hand is.
    hand_axes : three of three float
        Axes of the hand in the body's own: x, where fingers point; y; and z, out of the back of the
        hand. As given, of a flange whose z points ahead, so that a tool that points along the
        flange keeps all its directions.
    """

    base: str
    shoulder: str
    elbow: str
    hand: str
    hand_axes: tuple[tuple[float, float, float], ...] = Field(
        default=((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)), min_length=3, max_length=3
    )

    @property
    def points(self) -> tuple[str, ...]:
        """All markers that are looked at."""
        return self.base, self.shoulder, self.elbow, self.hand

    @property
    def names(self) -> tuple[str, ...]:
        """All markers that are derived."""
        clusters = (f"{body}_{part}" for body in ("back", "hand") for part in _PARTS)
        return (*clusters, "shoulder", "elbow")

    def find_assumptions(self, markers: Collection[str]) -> tuple[str, ...]:
        """Return what is assumed, a sentence each."""
        if not set(self.points) <= set(markers):
            return ()
        return ("the arm's base stands for the back, its tool for the hand",)

    def derive_of_bodies(
        self,
        positions: FloatArray,
        orientations: FloatArray,
        markers: tuple[str, ...],
        filled: npt.NDArray[np.bool_],
    ) -> DerivedMarkers:
        """Derive the markers of back and hand.

        Parameters
        ----------
        positions : array, shape (T, M, 3)
            Metres in the laboratory frame (z up); NaN where not seen.
        orientations : array, shape (T, M, 4)
            Unit quaternions (w, x, y, z), body2lab.
        markers : tuple of str, length M
            Their names, those of `points` among them.
        filled : bool array, shape (T, M)
            Which samples were filled.

        Returns
        -------
        DerivedMarkers
        """
        paths, is_filled = [], []
        same = np.eye(3)
        for body, axes, offsets in (
            (self.base, same, _ON_BASE_M),
            (self.hand, np.array(self.hand_axes), _ON_HAND_M),
        ):
            column = markers.index(body)
            turned = np.array(orientations[:, column])
            unseen = ~(np.linalg.norm(turned, axis=1) > _SMALLEST_NORM)
            turned[unseen] = (1.0, 0.0, 0.0, 0.0)
            body2lab = quaternion_to_rotation(turned)
            body2lab[unseen] = np.nan
            for offset in offsets:
                paths.append(positions[:, column] + body2lab @ (offset @ axes))
                is_filled.append(filled[:, column])
        for body in (self.shoulder, self.elbow):
            column = markers.index(body)
            paths.append(positions[:, column])
            is_filled.append(filled[:, column])
        return DerivedMarkers(self.names, np.stack(paths, axis=1), np.stack(is_filled, axis=1))
