"""Masses for a robot.yaml where a description gives none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio

from besman.robot.config import RobotConfig
from besman.robot.dynamics import possible_tensors
from besman.robot.files.fitted_shapes import moved_link
from besman.robot.files.joint_limits import borne_share

# Of the whole capsules: a UR5 has 18 kg in 20 litres of them.
_DENSITY_KG_M3 = 900.0
_LEAST_MASS_KG = 1e-3
_ROUNDS = 8
_LEAST_SHARE = 0.05
# What differs by less is rounded.
_SAME_SHARE = 1e-4


def assume_masses(model: Any, config: RobotConfig) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Return inertias for what has no mass, of the volume of its capsules.

    Parameters
    ----------
    model : pinocchio.Model
        The arm.
    config : RobotConfig
        With capsules.

    Returns
    -------
    inertia : dict of dict
        Of a robot.yaml, by link.
    notes : list of str
        What was assumed, in words.
    """
    inertia: dict[str, dict[str, Any]] = {}
    notes = _impossible(model, config)
    for joint in range(model.nv):
        link = moved_link(model, joint)
        if model.inertias[joint + 1].mass >= _LEAST_MASS_KG or link is None:
            continue
        frame = model.frames[model.getFrameId(link, pinocchio.FrameType.BODY)].placement
        bodies = [
            _solid(model, capsule, frame)
            for capsule in config.capsules
            if _parent(model, capsule.link) == joint
        ]
        if not bodies and joint + 1 < model.nv:
            # Joints that cross in a point: what the next one moves has the mass.
            continue
        # What is nowhere wide still has to be moved.
        whole = sum(bodies, pinocchio.Inertia.FromSphere(0.02, 0.03))
        moments = np.maximum(np.diag(whole.inertia), 1e-6)
        inertia[link] = {
            "mass_kg": round(whole.mass, 3),
            "com_m": [round(float(part), 4) for part in whole.lever],
            "inertia_kgm2": [float(f"{part:.3g}") for part in moments],
        }
        notes.append(
            f"mass of what joint {config.joints[joint].name} moves: {whole.mass:.2f} kg by the "
            "volume of its capsules, none is given"
        )
    return inertia, notes


def _impossible(model: Any, config: RobotConfig) -> list[str]:
    """Say of which joints the file's inertias are those of no body."""
    bodies = list(model.inertias)[1:]
    tensors = np.array([body.inertia for body in bodies])
    possible = possible_tensors(np.array([body.mass for body in bodies]), tensors)
    off = np.abs(possible - tensors).max(axis=(1, 2)) > _SAME_SHARE * np.abs(tensors).max(
        axis=(1, 2)
    )
    return [
        f"inertia of what joint {joint.name} moves: no body has the file's, the nearest that one "
        "can have is taken"
        for joint, one in zip(config.joints, off, strict=True)
        if one
    ]


def _parent(model: Any, link: str) -> int:
    """Return the joint that moves a link, -1 for none."""
    return int(model.frames[model.getFrameId(link, pinocchio.FrameType.BODY)].parentJoint) - 1


def _solid(model: Any, capsule: Any, frame: Any) -> Any:
    """Return the inertia of a capsule in a link's frame, kg m^2."""
    own = model.frames[model.getFrameId(capsule.link, pinocchio.FrameType.BODY)].placement
    ends = np.array(capsule.ends_m)
    along = ends[1] - ends[0]
    length = max(float(np.linalg.norm(along)), 1e-6)
    radius = capsule.radius_m
    mass = _DENSITY_KG_M3 * math.pi * radius**2 * (length + 4 / 3 * radius)
    turn = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along / length)
    place = pinocchio.SE3(turn.matrix(), ends.mean(axis=0))
    body = pinocchio.Inertia.FromCylinder(mass, radius, length + 4 / 3 * radius)
    return body.se3Action(frame.actInv(own * place))


def lighten_masses(
    inertia: dict[str, dict[str, Any]],
    joints: Sequence[dict[str, Any]],
    model: Any,
    accelerations: Sequence[float],
    tip: str,
    reach_m: float,
) -> list[str]:
    """Take less mass where the torques that are given could not move what was assumed.

    Capsules enclose a link and more; all assumed masses are made less by the same share.

    Parameters
    ----------
    inertia : dict of dict
        From `assume_masses`; is changed.
    joints, model, accelerations, tip, reach_m
        As in `besman.robot.files.joint_limits.assume_torques`, the model with these masses.

    Returns
    -------
    list of str
        What was assumed, in words.
    """
    share, lighter = 1.0, model.copy()
    moved = [joint for joint in range(model.nv) if moved_link(model, joint) in inertia]
    for _ in range(_ROUNDS if moved else 0):
        borne = borne_share(joints, lighter, accelerations, tip, reach_m)
        if borne >= 1 or share <= _LEAST_SHARE:
            break
        share = max(share * borne, _LEAST_SHARE)
        for joint in moved:
            whole = model.inertias[joint + 1]
            lighter.inertias[joint + 1] = pinocchio.Inertia(
                share * whole.mass, whole.lever, share * whole.inertia
            )
    if share == 1:
        return []
    for one in inertia.values():
        one["mass_kg"] = max(round(share * one["mass_kg"], 3), _LEAST_MASS_KG)
        moments = [max(share * moment, 1e-6) for moment in one["inertia_kgm2"]]
        one["inertia_kgm2"] = [float(f"{moment:.3g}") for moment in moments]
    return [f"assumed masses are taken by {share:.0%}: torques that are given could not move more"]
