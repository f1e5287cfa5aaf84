"""The limits of an arm's joints: what its file gives, and what is assumed where it gives none."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from besman.exceptions import RobotError
from besman.foreign.numbers import parse_number
from besman.robot.files.known_limits import KnownArm

FloatArray = npt.NDArray[np.float64]

# URDF has no limits of acceleration; this is what planners take for arms of which nothing is known.
ACCELERATION_RAD_S2 = 10.0
FILE, WISHED, ASSUMED = "the file", "the command", "assumed"
"""Where a limit comes from; what a maker publishes bears the arm's name."""
_SPEED_RAD_S = math.radians(120.0)
# No arm is built to carry nothing: of what it moves itself, and so far ahead of its flange and
# beside it, of its reach.
_LOAD_SHARE, _LOAD_AWAY = 0.1, 0.1
# A share above what gravity and the assumed acceleration ask for at most.
_TORQUE_RESERVE = 1.5
_LEAST_TORQUE_NM = 0.1
_MOST_TORQUE_NM = 1e6
_POSES = 400
# What "not given" is written as: no joint is faster or stronger.
_FASTEST_RAD_S, _STRONGEST_NM = 100.0, 1e5


def parse_limit_list(text: str | None, option: str, joints: Sequence[str]) -> list[float] | None:
    """Parse one number for all joints, or one for each, separated by commas.

    Raises
    ------
    RobotError
        If a number is none or not above zero, or there are not as many as joints.
    """
    if text is None:
        return None
    try:
        values = [parse_number(word.strip()) for word in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in (1, len(joints)) or not all(0 < value < math.inf for value in values):
        raise RobotError(
            f"{option}: got {text!r:.60}, expected one number above 0, or one for each of "
            f"{', '.join(joints)}, separated by commas"
        )
    return values * len(joints) if len(values) == 1 else values


def read_joints(
    chain: Sequence[ElementTree.Element],
    urdf: Path,
    velocity_deg_s: Sequence[float] | None,
    torque_nm: Sequence[float] | None,
    known: KnownArm | None = None,
) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the joints of a robot.yaml and what is assumed in them.

    Zero, or nothing, means that a limit is not given: it is taken from the options, else from what
    the arm's maker publishes, else assumed.
    Torques that nobody gives are None here; see `assume_torques`.

    Parameters
    ----------
    chain : list of Element
        The hinges from base to tip.
    urdf : Path
        Named in errors.
    velocity_deg_s, torque_nm : list of float, optional
        For each joint, used where the URDF has none.
    known : KnownArm, optional
        Published figures of as many joints.

    Raises
    ------
    RobotError
        If a limit is no number, or the lower one is not below the upper one.
    """
    joints: list[dict[str, Any]] = []
    assumed: list[str] = []
    for index, joint in enumerate(chain):
        name = str(joint.get("name"))
        low, high, note = _range(joint, urdf)
        assumed += note
        given = {
            "velocity_deg_s": _in_degrees(_positive(joint, "velocity", urdf, _FASTEST_RAD_S)),
            "torque_nm": _positive(joint, "effort", urdf, _STRONGEST_NM),
            "acceleration_rad_s2": None,
        }
        wished = {"velocity_deg_s": velocity_deg_s, "torque_nm": torque_nm}
        chosen, origin = _choose(given, wished, known, index)
        origin["position_deg"] = ASSUMED if note else FILE
        speed = chosen["velocity_deg_s"]
        if speed is None:
            speed = math.degrees(_SPEED_RAD_S)
            assumed.append(f"speed of {name}: {speed:.0f} degrees/s, not given")
        joints.append(
            {
                "name": name,
                "position_deg": [round(low, 6), round(high, 6)],
                "velocity_deg_s": round(speed, 6),
                "acceleration_rad_s2": chosen["acceleration_rad_s2"] or ACCELERATION_RAD_S2,
                "torque_nm": chosen["torque_nm"],
                "home_deg": round(0.0 if low < 0.0 < high else (low + high) / 2, 6),
                "origin": origin,
            }
        )
    if all(joint["origin"]["acceleration_rad_s2"] == ASSUMED for joint in joints):
        assumed.append("accelerations of all joints")
    return joints, assumed


def _choose(
    given: Mapping[str, float | None],
    wished: Mapping[str, Sequence[float] | None],
    known: KnownArm | None,
    index: int,
) -> tuple[dict[str, float | None], dict[str, str]]:
    """Take each limit of a joint from the file, the options or the published figures; say which."""
    chosen, origin = dict(given), {}
    for key, value in given.items():
        own = wished.get(key)
        published = known.limits.get(key) if known is not None else None
        if value is not None:
            origin[key] = FILE
        elif own is not None:
            chosen[key], origin[key] = own[index], WISHED
        elif known is not None and published is not None:
            chosen[key], origin[key] = published[index], known.arm
        else:
            origin[key] = ASSUMED
    return chosen, origin


def _in_degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)


def _range(joint: ElementTree.Element, urdf: Path) -> tuple[float, float, list[str]]:
    """Return the limits of position, degrees, and what is assumed of them."""
    name = joint.get("name")
    if joint.get("type") == "continuous":
        return -360.0, 360.0, [f"position of {name}, which is continuous: -360 to 360 degrees"]
    given = [_number(joint, key, urdf) for key in ("lower", "upper")]
    if given[0] is None and given[1] is None:
        return -180.0, 180.0, [f"position of {name}: -180 to 180 degrees, not given"]
    # URDF: what is left out of a <limit> is zero.
    low, high = (math.degrees(value or 0.0) for value in given)
    if low == high == 0.0:
        return -180.0, 180.0, [f"position of {name}: -180 to 180 degrees, not given"]
    if not low < high:
        raise RobotError(
            f"{urdf}: joint {name}: expected <limit> with lower below upper, got "
            f"{math.radians(low):g} and {math.radians(high):g}"
        )
    if max(-low, high) > 3600.0:
        low, high = max(low, -360.0), min(high, 360.0)
        return low, high, [f"position of {name}: -360 to 360 degrees, no limit is given"]
    return low, high, []


def _positive(joint: ElementTree.Element, key: str, urdf: Path, most: float) -> float | None:
    """Read a limit of a size that a joint can have, None where it is not given."""
    value = _number(joint, key, urdf)
    if value is not None and value < 0:
        raise RobotError(
            f"{urdf}: joint {joint.get('name')}: <limit> {key}: got {value:g}, expected 0 or more"
        )
    return value if value and value <= most else None


def _number(joint: ElementTree.Element, key: str, urdf: Path) -> float | None:
    """Read a number of a joint's ``<limit>``, None where there is none."""
    element = joint.find("limit")
    text = None if element is None else element.get(key)
    if text is None:
        return None
    try:
        value = parse_number(text)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise RobotError(
            f"{urdf}: joint {joint.get('name')}: <limit> {key}: got {text!r:.60}, expected a number"
        )
    return value


def assume_torques(
    joints: list[dict[str, Any]],
    model: Any,
    accelerations: Sequence[float],
    tip: str,
    reach_m: float,
) -> list[str]:
    """Write torques where none are given: 1.5 times what weight and acceleration ask for.

    A load is carried as well, a tenth of what the arm moves of itself.

    Parameters
    ----------
    joints : list of dict
        Of a robot.yaml; None under ``torque_nm`` becomes a number.
    model : pinocchio.Model
        The arm, within its limits of position.
    accelerations : list of float
        rad/s^2.
    tip : str
        The frame that the load is beside.
    reach_m : float
        Of the arm.

    Returns
    -------
    list of str
        What was assumed, in words.
    """
    if all(joint["torque_nm"] is not None for joint in joints):
        return []
    most, load_kg = _asked_torques(model, accelerations, tip, reach_m)
    assumed = []
    for joint, torque in zip(joints, most, strict=True):
        if joint["torque_nm"] is None:
            value = min(max(_TORQUE_RESERVE * float(torque), _LEAST_TORQUE_NM), _MOST_TORQUE_NM)
            joint["torque_nm"] = float(f"{value:.2g}")
            assumed.append(
                f"torque of {joint['name']}: {joint['torque_nm']:g} Nm, not given; the weight of "
                f"the arm and of {load_kg:.2g} kg and acceleration ask for two thirds"
            )
    return assumed


def borne_share(
    joints: Sequence[dict[str, Any]],
    model: Any,
    accelerations: Sequence[float],
    tip: str,
    reach_m: float,
) -> float:
    """Return the least share that torques which are given are of 1.5 times what is asked for.

    Parameters
    ----------
    joints, model, accelerations, tip, reach_m
        As in `assume_torques`.
    """
    if all(joint["torque_nm"] is None for joint in joints):
        return math.inf
    most, _ = _asked_torques(model, accelerations, tip, reach_m)
    return min(
        float(joint["torque_nm"]) / max(_TORQUE_RESERVE * float(torque), 1e-9)
        for joint, torque in zip(joints, most, strict=True)
        if joint["torque_nm"] is not None
    )


def _asked_torques(
    model: Any, accelerations: Sequence[float], tip: str, reach_m: float
) -> tuple[FloatArray, float]:
    """Return the torques (n,), Nm, that weight, a load, kg, and acceleration ask for; the load."""
    import pinocchio

    random = np.random.default_rng(0)
    load_kg = _LOAD_SHARE * sum(inertia.mass for inertia in list(model.inertias)[1:])
    flange = model.frames[model.getFrameId(tip, pinocchio.FrameType.BODY)]
    beside = flange.placement.act(_LOAD_AWAY * reach_m * np.array([1.0, 0.0, 1.0]))
    load = pinocchio.Inertia(load_kg, beside, np.zeros((3, 3)))
    model = model.copy()
    model.appendBodyToJoint(flange.parentJoint, load, pinocchio.SE3.Identity())
    data = model.createData()
    most = np.zeros(model.nv)
    span = model.upperPositionLimit - model.lowerPositionLimit
    for _ in range(_POSES):
        pose = model.lowerPositionLimit + span * random.random(model.nq)
        inertia = np.diag(pinocchio.crba(model, data, pose)) * accelerations
        weight = np.abs(pinocchio.computeGeneralizedGravity(model, data, pose))
        most = np.maximum(most, weight + np.abs(inertia))
    return most, load_kg
