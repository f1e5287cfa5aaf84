"""Inverse dynamics of an arm for whole trajectories."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from besman.robot.model import Robot
from besman.robot.parts import GRAVITY

FloatArray = npt.NDArray[np.float64]

_ROUNDING, _LEAST_GYRATION_M = 1e-9, 1e-3


@dataclass(frozen=True, eq=False)
class BodyInertias:
    """What each joint moves by itself (its link, and the tool with the last).

    Attributes
    ----------
    masses : array, shape (n,)
        kg.
    centres : array, shape (n, 3)
        Centres of mass in the joints' frames, metres.
    tensors : array, shape (n, 3, 3)
        Inertia about the centre of mass, axes of the joints' frames, kg m^2.
    """

    masses: FloatArray
    centres: FloatArray
    tensors: FloatArray


def body_inertias(robot: Robot) -> BodyInertias:
    """Take the inertias out of a robot's Pinocchio model, as bodies can have them."""
    inertias = list(robot.model.inertias)[1:]
    masses = np.array([inertia.mass for inertia in inertias])
    return BodyInertias(
        masses=masses,
        centres=np.array([inertia.lever for inertia in inertias]),
        tensors=possible_tensors(masses, np.array([inertia.inertia for inertia in inertias])),
    )


def possible_tensors(masses: FloatArray, tensors: FloatArray) -> FloatArray:
    """Return inertia tensors that bodies can have, each the one that is nearest.

    No principal moment is greater than the sum of the others, and none is below that of a mass 1 mm
    from its centre. Descriptions break this where numbers were rounded, left out or made up, and
    simulators refuse them.

    Parameters
    ----------
    masses : array, shape (n,)
        kg; those of what has none are left alone.
    tensors : array, shape (n, 3, 3)
        About the centre of mass, kg m^2.

    Returns
    -------
    array, shape (n, 3, 3)
        The same array where there is nothing to change.
    """
    moments = np.linalg.eigvalsh(tensors)
    lack = moments[:, 2] * (1.0 + _ROUNDING) - moments[:, 0] - moments[:, 1]
    wrong = (masses > 0) & ((moments[:, 0] <= 0) | (lack > 0))
    if not wrong.any():
        return tensors
    mended = tensors.copy()
    for index in np.flatnonzero(wrong):
        moment, axes = np.linalg.eigh(tensors[index])
        lack = max(moment[2] - moment[0] - moment[1], 0.0)
        # The nearest in the sum of squares.
        moment = moment + lack / 3.0 * np.array([1.0, 1.0, -1.0])
        if moment[0] < 0:
            moment = np.array([0.0, *[moment[1:].mean()] * 2])
        moment = np.maximum(moment, masses[index] * _LEAST_GYRATION_M**2)
        # A little beyond, so that rounding breaks nothing.
        moment[:2] *= 1.0 + 2.0 * _ROUNDING
        mended[index] = (axes * moment) @ axes.T
    return mended


def true_inertias(robot: Robot) -> BodyInertias:
    """Return the inertias with what the arm carries and its controller does not know of."""
    bodies, drives = body_inertias(robot), robot.drives
    if drives.payload == 0:
        return bodies
    flange2joint = robot.chain.tip @ np.linalg.inv(robot.tool.tcp2flange)
    place = flange2joint[:3, :3] @ drives.payload_centre + flange2joint[:3, 3]
    masses, centres, tensors = (
        part.copy() for part in (bodies.masses, bodies.centres, bodies.tensors)
    )
    masses[-1] += drives.payload
    centres[-1] += drives.payload / masses[-1] * (place - bodies.centres[-1])
    # Steiner: a mass at a point, about the common centre.
    apart = place - bodies.centres[-1]
    reduced = drives.payload * bodies.masses[-1] / masses[-1]
    tensors[-1] += reduced * (apart @ apart * np.eye(3) - np.outer(apart, apart))
    return BodyInertias(masses, centres, tensors)


def inverse_dynamics(
    robot: Robot,
    positions: npt.ArrayLike,
    velocities: npt.ArrayLike,
    accelerations: npt.ArrayLike,
) -> FloatArray:
    """Compute the joint torques of movements by the recursive Newton-Euler algorithm.

    Parameters
    ----------
    robot : Robot
        The arm with its tool.
    positions, velocities, accelerations : array, shape (..., n)
        rad, rad/s, rad/s^2.

    Returns
    -------
    array, shape (..., n)
        Nm.

    References
    ----------
    .. [1] R. Featherstone: Rigid Body Dynamics Algorithms, Springer 2008, section 5.3.
    """
    shape = np.shape(positions)
    flat = [
        np.ascontiguousarray(np.reshape(values, (-1, robot.n)), dtype=np.float64).view()
        for values in (positions, velocities, accelerations)
    ]
    for values in flat:
        # Or the kernel would be compiled once more for records, which nobody may write to.
        values.flags.writeable = False
    bodies = body_inertias(robot)
    chain = robot.chain
    parts = _rodrigues_parts(chain.placements, chain.axes)
    offsets = np.ascontiguousarray(chain.placements[:, :3, 3])
    torques = _newton_euler(
        parts, offsets, chain.axes, bodies.masses, bodies.centres, bodies.tensors, *flat
    )
    return torques.reshape(shape)


@numba.njit(cache=True, inline="always")
def _cross(a: FloatArray, b: FloatArray, out: FloatArray) -> None:  # pragma: no cover
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@numba.njit(cache=True, inline="always")
def _turn(R: FloatArray, v: FloatArray, out: FloatArray) -> None:  # pragma: no cover
    for i in range(3):
        out[i] = R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2]


@numba.njit(cache=True, inline="always")
def _turn_back(R: FloatArray, v: FloatArray, out: FloatArray) -> None:  # pragma: no cover
    for i in range(3):
        out[i] = R[0, i] * v[0] + R[1, i] * v[1] + R[2, i] * v[2]


def _rodrigues_parts(placements: FloatArray, axes: FloatArray) -> FloatArray:
    """Parts (n, 3, 3, 3) of rotations child2parent: part 0 + sin q part 1 + (1 - cos q) part 2."""
    rotations = placements[:, :3, :3]
    crosses = np.zeros((len(axes), 3, 3))
    for row, column, part in ((2, 1, 0), (0, 2, 1), (1, 0, 2)):
        crosses[:, row, column], crosses[:, column, row] = axes[:, part], -axes[:, part]
    return np.stack([rotations, rotations @ crosses, rotations @ crosses @ crosses], axis=1)


@numba.njit(cache=True, nogil=True)
def _newton_euler(
    parts: FloatArray,
    offsets: FloatArray,
    axes: FloatArray,
    masses: FloatArray,
    centres: FloatArray,
    tensors: FloatArray,
    positions: FloatArray,
    velocities: FloatArray,
    accelerations: FloatArray,
) -> FloatArray:  # pragma: no cover
    """Compute the torques (samples, n) by recursion outwards and back; see `inverse_dynamics`.

    In one piece: with one recursion in a function of its own it is slower.
    """
    samples, n = positions.shape
    torques = np.empty((samples, n))
    R = np.empty((n, 3, 3))
    force, moment = np.empty((n, 3)), np.empty((n, 3))
    w, dw, a = np.zeros(3), np.zeros(3), np.zeros(3)
    t1, t2, t3 = np.empty(3), np.empty(3), np.empty(3)
    for k in range(samples):
        for j in range(3):
            w[j] = dw[j] = a[j] = 0.0
        # A base that accelerates upwards feels gravity.
        a[2] = GRAVITY
        for i in range(n):
            sine, rest = np.sin(positions[k, i]), 1.0 - np.cos(positions[k, i])
            for j in range(3):
                for m in range(3):
                    R[i, j, m] = (
                        parts[i, 0, j, m] + sine * parts[i, 1, j, m] + rest * parts[i, 2, j, m]
                    )
            offset = offsets[i]
            _cross(w, offset, t1)
            _cross(w, t1, t2)
            _cross(dw, offset, t1)
            for j in range(3):
                t1[j] += t2[j] + a[j]
            _turn_back(R[i], t1, a)
            _turn_back(R[i], w, t1)
            _turn_back(R[i], dw, t2)
            for j in range(3):
                t3[j] = axes[i, j] * velocities[k, i]
                w[j] = t1[j] + t3[j]
            _cross(t1, t3, dw)
            for j in range(3):
                dw[j] += t2[j] + axes[i, j] * accelerations[k, i]
            _cross(w, centres[i], t1)
            _cross(w, t1, t2)
            _cross(dw, centres[i], t1)
            for j in range(3):
                force[i, j] = masses[i] * (a[j] + t1[j] + t2[j])
            _turn(tensors[i], w, t1)
            _cross(w, t1, t2)
            _turn(tensors[i], dw, t1)
            _cross(centres[i], force[i], t3)
            for j in range(3):
                moment[i, j] = t1[j] + t2[j] + t3[j]
        for i in range(n - 1, -1, -1):
            torques[k, i] = (
                axes[i, 0] * moment[i, 0] + axes[i, 1] * moment[i, 1] + axes[i, 2] * moment[i, 2]
            )
            if i > 0:
                _turn(R[i], force[i], t1)
                _turn(R[i], moment[i], t2)
                _cross(offsets[i], t1, t3)
                for j in range(3):
                    force[i - 1, j] += t1[j]
                    moment[i - 1, j] += t2[j] + t3[j]
    return torques
