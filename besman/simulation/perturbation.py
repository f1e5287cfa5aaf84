"""Perturbed worlds: a model that is wrong in named ways, and an arm that does not quite obey.

A perturbation changes a scene's MuJoCo model (friction, masses, joints, servos) and the set-points
that its servos get (delay, backlash, offset, noise). What a task builds stays as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field

from besman.config.stage import Config, NotNegative
from besman.robot.drives import delay_and_smooth
from besman.robot.model import Robot

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]

Share = Annotated[float, Field(ge=0, lt=1)]

# An offset is taken up within this time, so that it does not strike what lies in the tool.
_RAMP_S = 0.1
# Noise changes from cycle to cycle of the arm's controller, not from step to step.
_CYCLE_S = 0.008
# Quantities that are drawn: friction, mass of the object, masses of links, servo gains, frictions
# and dampings of joints, delays, backlash, offsets, lags. Which column of an orthogonal array each
# begins at: friction and delays have their own.
_SHIFTS = (0, 3, 4, 5, 2, 6, 1, 2, 3, 4)
_N_QUANTITIES = len(_SHIFTS)
# Sets its generator apart from those of the other quantities.
_NOISE = 100
# Worlds that are kept for the next motion: as many as are searched in and tried in after it.
_KEPT = 32


class Spreads(Config):
    """How far off a model may be; draws are uniform, for every joint by itself.

    Attributes
    ----------
    friction_share : float
        Plus or minus, of the coefficients of friction of all contacts and of the dry friction of
        an object's own hinge.
    object_mass_share, link_mass_share : float
        Plus or minus, of the mass and inertia of what is thrown, carried or pulled, of each link.
    joint_friction_share, joint_damping_share : float
        From none up to this share of the joint's torque limit: dry friction, and viscous friction
        at the joint's speed limit.
    servo_gain_share : float
        Plus or minus, of both gains of each servo.
    delay_s : float
        From none up to this: how late a servo gets its set-points.
    lag_s : float
        From none up to this: time constant with which set-points are smoothed, as controllers do.
    backlash_rad : float
        From none up to this: play between set-point and joint.
    offset_rad : float
        Plus or minus: error of a joint's zero.
    noise_rad : float
        Standard deviation of each joint's set-points, drawn anew every 8 ms.
    """

    friction_share: Share = 0.4
    object_mass_share: Share = 0.2
    link_mass_share: Share = 0.1
    joint_friction_share: Share = 0.02
    joint_damping_share: Share = 0.02
    servo_gain_share: Share = 0.2
    delay_s: Annotated[float, Field(ge=0, le=0.1)] = 0.004
    lag_s: Annotated[float, Field(ge=0, le=0.2)] = 0.0
    backlash_rad: NotNegative = 0.0
    offset_rad: NotNegative = 0.0
    noise_rad: NotNegative = 0.0


@dataclass(frozen=True, eq=False)
class Perturbation:
    """One way in which a world differs from its model, for an arm of n joints.

    Attributes
    ----------
    friction, object_mass : float
        Factors.
    link_masses, servo_gains : array, shape (n,)
        Factors.
    joint_friction, joint_damping : array, shape (n,)
        Added, Nm and Nm s/rad.
    delays, lags : array, shape (n,)
        Seconds.
    backlash, offsets : array, shape (n,)
        rad.
    noise : float
        rad.
    noise_seed : tuple of int
        The noise is the same for the same seed.
    """

    friction: float
    object_mass: float
    link_masses: FloatArray
    servo_gains: FloatArray
    joint_friction: FloatArray
    joint_damping: FloatArray
    delays: FloatArray
    lags: FloatArray
    backlash: FloatArray
    offsets: FloatArray
    noise: float = 0.0
    noise_seed: tuple[int, ...] = (0,)


@lru_cache(maxsize=_KEPT)
def draw_perturbation(spreads: Spreads, robot: Robot, seed: tuple[int, ...]) -> Perturbation:
    """Draw a perturbation.

    Parameters
    ----------
    spreads : Spreads
        How far off.
    robot : Robot
        Whose torque and speed limits the frictions of its joints are shares of.
    seed : tuple of int
        The same seed gives the same perturbation.

    Returns
    -------
    Perturbation
    """
    # A generator for each quantity: a spread that changes leaves the other draws as they are.
    unit = [
        np.random.default_rng((*seed, place)).uniform(-1.0, 1.0, robot.n)
        for place in range(_N_QUANTITIES)
    ]
    return _perturbation_of(spreads, robot, unit, seed)


@lru_cache(maxsize=_KEPT)
def draw_two_level(
    spreads: Spreads, robot: Robot, seed: tuple[int, ...], n: int
) -> tuple[Perturbation, ...]:
    """Draw perturbations few of which tell as much as many that are drawn independently.

    Every quantity is one standard deviation above or below its middle, in a two-level orthogonal
    array [1]_: with a power of two of models each quantity is as often above as below, and those
    of one kind (all delays, say), and friction and delays, do so independently of each other. So
    the mean of an outcome is that of the middle, and its variance the sum of what single
    quantities cause, as far as it is linear in them. Quantities that share a column do so with a
    random sign.

    Parameters
    ----------
    spreads, robot, seed
        As in `draw_perturbation`.
    n : int
        How many.

    Returns
    -------
    tuple of Perturbation, length n

    References
    ----------
    .. [1] R. L. Plackett, J. P. Burman: The design of optimum multifactorial experiments.
       Biometrika 33(4), 1946, DOI 10.1093/biomet/33.4.305.
    """
    from scipy.linalg import hadamard

    size = max(1 << (n - 1).bit_length(), 4)
    columns = hadamard(size)[:n, 1:]
    signs = np.random.default_rng(tuple(seed)).choice([-1.0, 1.0], (_N_QUANTITIES, robot.n))
    places = (np.arange(robot.n) + np.array(_SHIFTS)[:, None]) % columns.shape[1]
    # The standard deviation of a uniform draw between -1 and 1.
    units = columns[:, places] * signs / np.sqrt(3.0)
    return tuple(
        _perturbation_of(spreads, robot, list(unit), (*seed, index))
        for index, unit in enumerate(units)
    )


def _perturbation_of(
    spreads: Spreads, robot: Robot, unit: Sequence[FloatArray], noise_seed: Sequence[int]
) -> Perturbation:
    """Return the perturbation of draws (10, n) between -1 and 1."""
    limits = robot.limits

    def up_to(place: int, most: float) -> FloatArray:
        return np.asarray(0.5 * most * (1.0 + unit[place]))

    return Perturbation(
        friction=1.0 + spreads.friction_share * float(unit[0][0]),
        object_mass=1.0 + spreads.object_mass_share * float(unit[1][0]),
        link_masses=1.0 + spreads.link_mass_share * unit[2],
        servo_gains=1.0 + spreads.servo_gain_share * unit[3],
        joint_friction=limits.torque * up_to(4, spreads.joint_friction_share),
        joint_damping=limits.torque / limits.velocity * up_to(5, spreads.joint_damping_share),
        delays=up_to(6, spreads.delay_s),
        lags=up_to(9, spreads.lag_s),
        backlash=up_to(7, spreads.backlash_rad),
        offsets=spreads.offset_rad * unit[8],
        noise=spreads.noise_rad,
        noise_seed=tuple(noise_seed),
    )


@lru_cache(maxsize=_KEPT)
def perturb_model(model: mujoco.MjModel, perturbation: Perturbation) -> mujoco.MjModel:
    """Return a perturbed copy of a scene.

    Parameters
    ----------
    model : mujoco.MjModel
        The arm's joints and servos come first.
    perturbation : Perturbation
        Of that arm.

    Returns
    -------
    mujoco.MjModel
        Constants that follow from the masses are computed anew. Kept for the next call: not to be
        changed.
    """
    import mujoco

    changed, n = copy(model), len(perturbation.link_masses)
    changed.geom_friction[:, 0] *= perturbation.friction
    changed.pair_friction[:, :2] *= perturbation.friction
    links = model.jnt_bodyid[:n]
    _scale_mass(changed, links, perturbation.link_masses)
    objects = _objects(model, n)
    _scale_mass(changed, objects, np.full(len(objects), perturbation.object_mass))
    changed.dof_frictionloss[:n] += perturbation.joint_friction
    changed.dof_damping[:n] += perturbation.joint_damping
    own = np.isin(model.dof_bodyid, objects)
    changed.dof_frictionloss[own] *= perturbation.friction
    changed.actuator_gainprm[:n, 0] *= perturbation.servo_gains
    changed.actuator_biasprm[:n, 1:3] *= perturbation.servo_gains[:, None]
    mujoco.mj_setConst(changed, mujoco.MjData(changed))
    return changed


def _objects(model: mujoco.MjModel, n: int) -> npt.NDArray[np.int64]:
    """Return the bodies that move and are no part of the arm with its tool."""
    arm = model.body_rootid[model.jnt_bodyid[0]]
    moving = model.body_dofnum[model.body_rootid] > 0
    return np.flatnonzero(moving & (model.body_rootid != arm))


def _scale_mass(
    model: mujoco.MjModel, bodies: npt.NDArray[np.integer], factors: FloatArray
) -> None:
    """Scale mass and inertia of bodies in place."""
    model.body_mass[bodies] *= factors
    model.body_inertia[bodies] *= factors[:, None]


def perturb_controls(
    controls: FloatArray, perturbation: Perturbation, time_step_s: float
) -> FloatArray:
    """Return the set-points that an arm's servos get in a perturbed world.

    Parameters
    ----------
    controls : array, shape (T, nu)
        What is sent at every step, rad; the arm's joints first.
    perturbation : Perturbation
        Of that arm.
    time_step_s : float
        Step of the simulation.

    Returns
    -------
    array, shape (T, nu)
    """
    n, steps = len(perturbation.delays), len(controls)
    time: FloatArray = np.asarray(time_step_s * np.arange(steps), dtype=np.float64)
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.minimum(time / _RAMP_S, 1.0))
    noise = _noise(time, perturbation, n)
    changed = controls.copy()
    for joint in range(n):
        delay, lag = perturbation.delays[joint], perturbation.lags[joint]
        late = delay_and_smooth(controls[:, joint], delay, lag, time_step_s)
        late = late + perturbation.offsets[joint] * ramp
        if noise is not None:
            late = late + noise[:, joint]
        if perturbation.backlash[joint] > 0:
            late = follow_with_play(late, perturbation.backlash[joint])
        changed[:, joint] = late
    return changed


def _noise(time: FloatArray, perturbation: Perturbation, n: int) -> FloatArray | None:
    """Draw noise (T, n), straight between the cycles of the controller; none at the start."""
    if perturbation.noise == 0:
        return None
    random = np.random.default_rng((*perturbation.noise_seed, _NOISE))
    cycles = _CYCLE_S * np.arange(int(time[-1] / _CYCLE_S) + 2)
    drawn = perturbation.noise * random.standard_normal((len(cycles), n))
    drawn[0] = 0.0
    return np.column_stack([np.interp(time, cycles, column) for column in drawn.T])


def follow_with_play(driving: FloatArray, width: float) -> FloatArray:
    """Follow a movement through a gear with play.

    Parameters
    ----------
    driving : array, shape (T,)
        The driving side, at the middle of the play at first.
    width : float
        Of the play, in the same unit.

    Returns
    -------
    array, shape (T,)
        The driven side: it stays until the driving side has crossed the play.

    References
    ----------
    .. [1] M. Nordin, P.-O. Gutman: Controlling mechanical systems with backlash - a survey,
       Automatica 38(10), 2002 (the hysteresis model), DOI 10.1016/S0005-1098(02)00047-X.
    """
    driven = np.empty_like(driving)
    at, half = driving[0], 0.5 * width
    for step, value in enumerate(driving):
        at = min(max(at, value - half), value + half)
        driven[step] = at
    return driven
