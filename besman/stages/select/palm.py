"""How the hand pushed what it throws, in place of how it was turned.

Two keypoints on a hand tell badly how it is turned, and fingers hold a ball where a scoop would
drop it. What lies in a scoop stays there while the scoop opens along the push: the hand's
acceleration, and gravity borne.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.stages.select.flight import GRAVITY
from besman.stages.select.release import HandPath

FloatArray = npt.NDArray[np.float64]

_LEAST_SPEED_M_S = 0.1
_LEAST_BORNE = 0.5


def turn_palm_to_push(hand: HandPath, forward: FloatArray, time: FloatArray) -> FloatArray:
    """Turn a hand so that its palm faces along the push that its path asks of it.

    Once the hand is fastest, what it threw is gone, and the palm stays as it is.

    Parameters
    ----------
    hand : HandPath
        Smooth enough to be differentiated twice.
    forward : array, shape (3,)
        Where the person faces, in the laboratory frame; taken where the throw goes straight up.
    time : array, shape (T,)
        When to tell it, seconds of the recording.

    Returns
    -------
    array, shape (T, 3, 3)
        Hand to laboratory: x towards the fingers, z out of the back of the hand.
    """
    velocities = hand.velocities
    push = np.gradient(velocities, hand.time, axis=0) + np.array([0.0, 0.0, GRAVITY])
    # What slows down faster than it falls would leave the hand: an arm, slower, bears it on.
    push[:, 2] = np.maximum(push[:, 2], _LEAST_BORNE * GRAVITY)
    push[hand.release :] = push[hand.release]
    push = np.stack([np.interp(time, hand.time, one) for one in push.T], axis=1)
    ahead = velocities[hand.release] * [1.0, 1.0, 0.0]
    if np.linalg.norm(ahead) < _LEAST_SPEED_M_S:
        ahead = forward * [1.0, 1.0, 0.0]
    left = _unit(np.cross([0.0, 0.0, 1.0], ahead))
    # Nothing is pushed sideways: the palm turns in the vertical plane of the throw.
    push -= np.outer(push @ left, left)
    palm = _unit(push)
    y = np.broadcast_to(-left, palm.shape)
    return np.stack([np.cross(y, -palm), y, -palm], axis=-1)


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit
