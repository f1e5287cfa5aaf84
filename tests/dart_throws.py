"""Throws as a hand makes them."""

import numpy as np
from scipy.spatial.transform import Rotation

from besman.geometry.frames import rotation_to_quaternion
from besman.records import HandTrajectory


def throw(index, size=1.0):
    """A dart-like throw from beside the head, half a second, hand turning forward."""
    rng = np.random.default_rng(index)
    time = np.linspace(0, 0.5, 51)
    u = time / 0.5
    u = 10 * u**3 - 15 * u**4 + 6 * u**5
    path = np.array([0.1, -0.4, 0.15]) + rng.normal(0, 0.02, 3)
    path = path + size * np.outer(u, [0.5, 0.1, 0.3])
    elevation = np.radians(45 - 35 * u)
    turn = Rotation.from_rotvec(np.outer(-elevation, [0, 1, 0])).as_matrix()
    # The palm looks forward: back of the hand (z) backwards, fingers (x) up.
    palm = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])
    poses = np.hstack([path, rotation_to_quaternion(turn @ palm)])
    return HandTrajectory(time, poses, f"a.tsv:{index}", "throw", np.array([2.1, 0.0, -1.35]))
