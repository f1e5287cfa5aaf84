"""Parts that scenes share: solver options, the tool's frame, its sensors."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from besman.robot.model import Robot
from besman.robot.mujoco_model import ARM_BIT, matrix_to_quaternion

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]

# A contact is as hard as it gets from a fifth of a millimetre on, not from one: the outcome of a
# throw then depends half as much on the time step.
_IMPEDANCE = (0.8, 0.95, 0.0002, 0.5, 2.0)
_FAR_M = 1e4


def set_contact_options(spec: mujoco.MjSpec) -> None:
    """Choose the solver's options for few, stiff contacts with friction."""
    import mujoco

    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # Friction that is softer than the contact itself lets things creep.
    spec.option.impratio = 10.0
    # Made for scenes of many bodies; here they cost a tenth of the time.
    spec.option.disableflags |= (
        mujoco.mjtDisableBit.mjDSBL_MIDPHASE | mujoco.mjtDisableBit.mjDSBL_ISLAND
    )


def contact(
    time_s: float, friction: float, impedance: Sequence[float] = _IMPEDANCE
) -> dict[str, list[float]]:
    """Give the contact parameters of a geom.

    Parameters
    ----------
    time_s : float
        Time constant of the contact, seconds.
    friction : float
        Coefficient of sliding friction.
    impedance : sequence of 5 floats
        MuJoCo's solimp: the contact's impedance at first touch and at a depth (m), that depth, and
        the curve between.
    """
    return {
        "solref": [time_s, 1.0],
        "solimp": list(impedance),
        "friction": [friction, 0.005, 0.0001],
    }


def add_tool_body(last: Any, robot: Robot, name: str) -> Any:
    """Hang a body without mass on the last link, in the frame of the tool centre point."""
    tip = robot.chain.tip
    return last.add_body(name=name, pos=tip[:3, 3], quat=matrix_to_quaternion(tip[:3, :3]))


def add_tool_capsule(last: Any, robot: Robot, **parameters: Any) -> None:
    """Add the capsule that the robot's tool says to the last link; nothing if it has none."""
    import mujoco

    tool = robot.tool
    if tool.capsule_radius == 0:
        return
    flange = robot.chain.tip @ np.linalg.inv(tool.tcp2flange)
    ends = tool.capsule_ends @ flange[:3, :3].T + flange[:3, 3]
    last.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=ends.ravel(),
        size=[tool.capsule_radius, 0.0, 0.0],
        mass=0.0,
        contype=ARM_BIT,
        conaffinity=0,
        **parameters,
    )


def add_tool_sensors(spec: mujoco.MjSpec) -> None:
    """Add position (3) and orientation (4, wxyz) of the tool centre point in the world."""
    import mujoco

    site, kinds = mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtSensor
    spec.add_sensor(name="tcp", type=kinds.mjSENS_FRAMEPOS, objtype=site, objname="tcp")
    spec.add_sensor(name="turn", type=kinds.mjSENS_FRAMEQUAT, objtype=site, objname="tcp")


def add_point_sensor(spec: mujoco.MjSpec, site: str) -> None:
    """Add the position (3) of a site in the frame of the tool centre point."""
    import mujoco

    kind = mujoco.mjtObj.mjOBJ_SITE
    spec.add_sensor(
        name=site,
        type=mujoco.mjtSensor.mjSENS_FRAMEPOS,
        objtype=kind,
        objname=site,
        reftype=kind,
        refname="tcp",
    )


def lay_in_tool(model: mujoco.MjModel, starts: FloatArray, ahead_m: float) -> FloatArray:
    """Return initial states in which a free body lies along the tool's axis.

    Parameters
    ----------
    model : mujoco.MjModel
        With the arm's joints first, then the body's free joint.
    starts : array, shape (B, n)
        Joint angles, rad.
    ahead_m : float
        Where the body's frame is on the z axis of the tool centre point, metres.

    Returns
    -------
    array, shape (B, nq)
    """
    import mujoco

    from besman.simulation.physics import spare_data

    if len(starts) > 1 and not starts.strides[0]:
        # The same again and again, see `besman.simulation.episodes.repeat_movement`.
        once = lay_in_tool(model, starts[:1], ahead_m)
        return np.broadcast_to(once, (len(starts), model.nq))
    data = spare_data(model)
    qpos = np.empty((len(starts), model.nq))
    n = starts.shape[1]
    for index, start in enumerate(starts):
        data.qpos[:n] = start
        mujoco.mj_kinematics(model, data)
        rotation = data.site("tcp").xmat.reshape(3, 3)
        qpos[index, :n] = start
        qpos[index, n : n + 3] = data.site("tcp").xpos + rotation[:, 2] * ahead_m
        qpos[index, n + 3 :] = matrix_to_quaternion(rotation)
    return qpos


def fix_pairs(spec: mujoco.MjSpec, thing: str) -> None:
    """List which shapes can meet those of body `thing`, in place of looking for them in each step.

    The same contacts with the same parameters as MuJoCo's own search would give, except that they
    are those of the thing alone, where that would mix them with those of an arm's bare link.

    Parameters
    ----------
    spec : mujoco.MjSpec
        A scene in which nothing else meets.
    thing : str
        Name of a body.
    """
    shapes = [shape for body in spec.bodies for shape in body.geoms]
    for number, shape in enumerate(shapes):
        shape.name = shape.name or f"shape{number}"
    excluded = {other.bodyname1 for other in spec.excludes if other.bodyname2 == thing}
    mine = [shape for shape in shapes if shape.parent.name == thing]
    others = [shape for shape in shapes if shape.parent.name not in {thing, *excluded}]
    for one, other in product(mine, others):
        if one.conaffinity & other.contype or other.conaffinity & one.contype:
            slide, turn, roll = np.maximum(one.friction, other.friction)
            spec.add_pair(
                geomname1=other.name,
                geomname2=one.name,
                condim=max(one.condim, other.condim),
                solref=one.solref,
                solimp=one.solimp,
                friction=[slide, slide, turn, roll, roll],
            )
    for shape in shapes:
        shape.contype = shape.conaffinity = 0
    _add_far_shape(spec)


def _add_far_shape(spec: mujoco.MjSpec) -> None:
    """Add a shape that is not seen, meets nothing and stands far above everything.

    MuJoCo looks for the axes along which shapes are spread before it looks which can meet, also
    where none is looked for: a twentieth of a step. With this one they are spread along z, which it
    finds at once. Nothing else changes by a bit.
    """
    import mujoco

    far = spec.worldbody.add_body(name="far", pos=[0.0, 0.0, _FAR_M])
    far.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[0.001, 0.0, 0.0],
        mass=0.0,
        rgba=[0.0, 0.0, 0.0, 0.0],
        contype=0,
        conaffinity=0,
    )
