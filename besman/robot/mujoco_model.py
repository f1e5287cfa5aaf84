"""The arm in MuJoCo: the same joints and inertias as in Pinocchio, driven by position servos."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from besman.robot.model import Robot
from besman.robot.parts import GRAVITY

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]

# Collision bits: what is thrown meets the arm and its tool; these do not meet each other, because
# self-collision is measured on the movement itself, exactly and without contact forces.
ARM_BIT = 1
# A servo reaches its torque limit at this deviation.
_SATURATION_RAD = 0.03


@dataclass(frozen=True, eq=False)
class ServoGains:
    """Gains of the arm's position servos.

    Attributes
    ----------
    kp, kv : array, shape (n,)
        Nm/rad and Nm s/rad.
    """

    kp: FloatArray
    kv: FloatArray


def servo_gains(robot: Robot) -> ServoGains:
    """Choose stiff, critically damped servos from torque limits and the inertia at home."""
    import pinocchio

    kp = robot.limits.torque / _SATURATION_RAD
    inertia = np.diag(pinocchio.crba(robot.model, robot.model.createData(), robot.home))
    return ServoGains(kp=kp, kv=2.0 * np.sqrt(kp * inertia))


def arm_spec(robot: Robot, time_step_s: float) -> tuple[mujoco.MjSpec, Any]:
    """Describe the arm for MuJoCo: bodies, hinges, servos, capsules of the links.

    Parameters
    ----------
    robot : Robot
        The arm with its tool.
    time_step_s : float
        Step of the simulation.

    Returns
    -------
    spec : mujoco.MjSpec
        To be completed and compiled. Site ``tcp`` is the tool centre point. The tool's own
        capsule is left out: tasks bring the true shape of their tool.
    last : mujoco.MjsBody
        The last link, to hang the tool on.
    """
    import mujoco

    from besman.robot.dynamics import true_inertias

    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = time_step_s
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    chain, inertias, gains, drives = (
        robot.chain,
        true_inertias(robot),
        servo_gains(robot),
        robot.drives,
    )
    body = spec.worldbody
    bodies = [body]
    for index, name in enumerate(robot.joint_names):
        placement = chain.placements[index]
        body = body.add_body(
            name=name,
            pos=placement[:3, 3],
            quat=matrix_to_quaternion(placement[:3, :3]),
            mass=inertias.masses[index],
            ipos=inertias.centres[index],
            fullinertia=inertias.tensors[index][[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
            explicitinertial=True,
        )
        joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=chain.axes[index])
        joint.frictionloss = drives.friction[index]
        # Of a polynomial in the speed.
        joint.damping = [drives.damping[index], 0.0, 0.0]
        kp, kv = drives.gains[index] * np.array([gains.kp[index], gains.kv[index]])
        _add_servo(spec, name, kp, kv, robot.limits.torque[index])
        bodies.append(body)
    for index, radius in enumerate(chain.capsule_radii):
        if chain.capsule_links[index] != "tool":
            _add_capsule(bodies[chain.capsule_joints[index] + 1], chain.capsule_ends[index], radius)
    body.add_site(name="tcp", pos=chain.tip[:3, 3], quat=matrix_to_quaternion(chain.tip[:3, :3]))
    return spec, body


def _add_capsule(body: Any, ends: FloatArray, radius: float) -> None:
    """Add a capsule (2, 3); MuJoCo takes one without length for a mistake, so it is a sphere."""
    import mujoco

    is_sphere = np.linalg.norm(ends[1] - ends[0]) < 1e-6
    shape: dict[str, Any] = (
        {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "pos": ends[0]}
        if is_sphere
        else {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "fromto": ends.ravel()}
    )
    body.add_geom(size=[radius, 0.0, 0.0], mass=0.0, contype=ARM_BIT, conaffinity=0, **shape)


def _add_servo(spec: mujoco.MjSpec, joint: str, kp: float, kv: float, torque: float) -> None:
    """Add a position servo whose torque is limited."""
    import mujoco

    servo = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    servo.set_to_position(kp=kp, kv=kv)
    servo.forcelimited = True
    servo.forcerange = [-torque, torque]


def servo_controls(
    robot: Robot,
    positions: npt.ArrayLike,
    velocities: npt.ArrayLike,
    accelerations: npt.ArrayLike,
) -> FloatArray:
    """Compute set-points with feed-forward, so that ideal servos need no deviation to act.

    See `besman.simulation.setpoints.servo_setpoints` for what the servos get of them.

    Parameters
    ----------
    robot : Robot
        The arm with its tool.
    positions, velocities, accelerations : array, shape (..., n)
        rad, rad/s, rad/s^2.

    Returns
    -------
    array, shape (..., n)
        rad.
    """
    from besman.robot.dynamics import inverse_dynamics

    gains = servo_gains(robot)
    movement = (positions, velocities, accelerations)
    q, v, a = (np.asarray(part, dtype=np.float64) for part in movement)
    # The same torques of an arm at rest need not be computed a thousand times.
    moving = _moving_samples(q, v, a) if q.ndim > 1 else None
    if moving is None:
        torques = inverse_dynamics(robot, q, v, a)
    else:
        torques = np.empty(q.shape)
        first = (..., slice(moving), slice(None))
        torques[first] = inverse_dynamics(robot, q[first], v[first], a[first])
        torques[..., moving:, :] = torques[..., moving - 1 : moving, :]
    return np.asarray(q + (gains.kv * v + torques) / gains.kp)


def _moving_samples(*movement: FloatArray) -> int:
    """Return how many samples (axis -2) there are until nothing changes any more, at least 1."""
    changes = np.zeros(movement[0].shape[-2] - 1, dtype=bool)
    for part in movement:
        differs = part[..., 1:, :] != part[..., :-1, :]
        changes |= differs.any(axis=(*range(part.ndim - 2), part.ndim - 1))
    return int(len(changes) - changes[::-1].argmax()) + 1 if changes.any() else 1


def matrix_to_quaternion(rotation: FloatArray) -> FloatArray:
    """Return the quaternion (w, x, y, z) of a rotation matrix, shape (3, 3)."""
    import mujoco

    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return quaternion
