"""Turns about one axis: what the closed-form inverse kinematics is put together from.

References
----------
R. M. Murray, Z. Li, S. S. Sastry: A mathematical introduction to robotic manipulation, 1994,
section 3.2 (the subproblems of Paden and Kahan).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.kinematics import compiled

FloatArray = npt.NDArray[np.float64]

# Sine of an angle (and other shares) below which a turn is singular: any angle will do.
SINGULAR = 1e-7
# What rounding (of the model, too) may push a pose beyond the reach, as a share of it.
_ROUNDING = 1e-7


@compiled
def rotate(axis: FloatArray, angle: float, vector: FloatArray, result: FloatArray) -> None:
    """Write a vector (3,) turned about a unit axis into `result` (Rodrigues)."""
    c, s = np.cos(angle), np.sin(angle)
    along = (axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2]) * (1.0 - c)
    x = axis[1] * vector[2] - axis[2] * vector[1]
    y = axis[2] * vector[0] - axis[0] * vector[2]
    z = axis[0] * vector[1] - axis[1] * vector[0]
    u, v, w = vector[0], vector[1], vector[2]
    result[0] = c * u + s * x + along * axis[0]
    result[1] = c * v + s * y + along * axis[1]
    result[2] = c * w + s * z + along * axis[2]


@compiled
def turn_between(axis: FloatArray, first: FloatArray, second: FloatArray) -> tuple[float, float]:
    """Return the angle about an axis from one vector to another, and the lesser's length."""
    a = axis[0] * first[0] + axis[1] * first[1] + axis[2] * first[2]
    b = axis[0] * second[0] + axis[1] * second[1] + axis[2] * second[2]
    dot = first_square = second_square = 0.0
    for k in range(3):
        u, v = first[k] - a * axis[k], second[k] - b * axis[k]
        dot += u * v
        first_square += u * u
        second_square += v * v
    sine = (
        axis[0] * (first[1] * second[2] - first[2] * second[1])
        + axis[1] * (first[2] * second[0] - first[0] * second[2])
        + axis[2] * (first[0] * second[1] - first[1] * second[0])
    )
    return np.arctan2(sine, dot), np.sqrt(min(first_square, second_square))


@compiled
def turn_to_height(
    axis: FloatArray, vector: FloatArray, along: FloatArray, height: float
) -> tuple[float, float, int]:
    """Turn a vector about an axis until its component along another direction is `height`.

    Returns
    -------
    first, second : float
        Both angles, rad.
    state : int
        1 solved, 0 no angle does, -1 every angle does.
    """
    shared = axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2]
    lean = axis[0] * along[0] + axis[1] * along[1] + axis[2] * along[2]
    a = -shared * lean
    for k in range(3):
        a += vector[k] * along[k]
    b = (
        along[0] * (axis[1] * vector[2] - axis[2] * vector[1])
        + along[1] * (axis[2] * vector[0] - axis[0] * vector[2])
        + along[2] * (axis[0] * vector[1] - axis[1] * vector[0])
    )
    wanted = height - shared * lean
    radius = np.sqrt(a * a + b * b)
    if radius < SINGULAR:
        return 0.0, 0.0, (-1 if abs(wanted) < SINGULAR else 0)
    ratio = wanted / radius
    if abs(ratio) > 1.0 + _ROUNDING:
        return 0.0, 0.0, 0
    middle, half = np.arctan2(b, a), np.arccos(min(max(ratio, -1.0), 1.0))
    return middle + half, middle - half, 1


@compiled
def dot_product(first: FloatArray, second: FloatArray) -> float:
    """Return the inner product of two vectors (3,)."""
    return float(first[0] * second[0] + first[1] * second[1] + first[2] * second[2])
