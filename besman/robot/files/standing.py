"""How an arm of which nobody says it stands: height, pedestal, flange and home."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio

from besman.geometry.joint_axis import joint_axis
from besman.robot.capsules import distances_to_axis
from besman.robot.collision import distances
from besman.robot.config import RobotConfig
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot
from besman.robot.workspace import least_singular_values

FloatArray = npt.NDArray[np.float64]

# Shoulders of people and of the arms that come with besman are about this high.
_SHOULDER_M = 1.1
SHORT_ARM_M = 0.5
"""Reach below which an arm gets shorter tools."""

_LEAST_PEDESTAL_M = 0.05
_LEAST_STANDING_M = 0.4
_PEDESTAL_SHARE = 0.1
ALONG_AXIS = 0.99
"""Cosine of what counts as along an axis."""

# The search for a home: how many at once, how often, and how fast it narrows.
_CANDIDATES = 400
_BEST = 40
_ROUNDS = 24
_FIRST_CANDIDATES = 6000
_CLEAR_M = 0.02
# Shares of the reach: how far ahead the hand is held, and how high above the shoulder at most.
_AHEAD, _WIDEST_RAD = 0.6, np.pi
_INSIDE = 0.08


def arm_reach(model: Any, tip: str) -> tuple[float, float]:
    """Return how far a flange is from the first joint's axis at most, and how high the shoulder is.

    Parameters
    ----------
    model : pinocchio.Model
        The arm, its base on the floor.
    tip : str
        Link of the flange.

    Returns
    -------
    reach, shoulder : float
        Sum of the ways from the second joint on, and its height above the base, metres.
    """
    placements = list(model.jointPlacements)[1:]
    flange = model.frames[model.getFrameId(tip, pinocchio.FrameType.BODY)].placement
    ways = [float(np.linalg.norm(place.translation)) for place in placements[2:]]
    ways.append(float(np.linalg.norm(flange.translation)))
    shoulder = placements[0] * placements[1] if len(placements) > 1 else placements[0]
    return sum(ways), float(shoulder.translation[2])


def base_offset(model: Any, config: RobotConfig) -> float:
    """Return how far beside its origin an arm stands, metres: its base, or what turns on that.

    Parameters
    ----------
    model : pinocchio.Model
    config : RobotConfig
        With capsules; 0 where neither has any.
    """
    for joint in (0, 1):
        found = []
        for capsule in config.capsules:
            frame = model.frames[model.getFrameId(capsule.link, pinocchio.FrameType.BODY)]
            if frame.parentJoint != joint:
                continue
            place = (
                model.jointPlacements[1] if joint else pinocchio.SE3.Identity()
            ) * frame.placement
            ends = np.array(capsule.ends_m) @ place.rotation.T + place.translation
            beside = distances_to_axis(np.zeros((1, 3)), ends * [1.0, 1.0, 0.0])
            found.append(max(float(beside[0]) - capsule.radius_m, 0.0))
        if found:
            return min(found)
    return 0.0


def assume_mounting(
    reach: float, shoulder: float, has_base: bool = False, beside_m: float = 0.0
) -> dict[str, float]:
    """Return the mounting of a robot.yaml: the shoulder as high as the arm is long.

    Parameters
    ----------
    reach, shoulder : float
        See `arm_reach`.
    has_base : bool
        Whether the description has what the arm stands on, a torso or a mobile base: it stands on
        the floor then, unless it is a small one.
    beside_m : float
        How far beside its origin the base stands (`base_offset`): a column at the origin would not
        carry what stands further away than it is thick, as an arm of a scene may.
    """
    height = round(max(min(reach, _SHOULDER_M) - shoulder, 0.0), 2)
    if has_base and shoulder >= _LEAST_STANDING_M:
        height = 0.0
    if height < _LEAST_PEDESTAL_M:
        return {"height_m": 0.0, "yaw_deg": 0.0, "pedestal_radius_m": 0.0}
    radius = round(min(_PEDESTAL_SHARE * min(reach, 1.0), height / 2), 3)
    radius = radius if beside_m <= radius else 0.0
    return {"height_m": height, "yaw_deg": 0.0, "pedestal_radius_m": radius}


def assume_tool_scale(reach: float) -> tuple[float, list[str]]:
    """Return how much shorter the tools of a short arm are, and what is said of it.

    Parameters
    ----------
    reach : float
        See `arm_reach`.
    """
    if reach >= SHORT_ARM_M:
        return 1.0, []
    scale = max(round(reach / SHORT_ARM_M, 2), 0.01)
    return scale, [f"tools: {scale:.0%} of their length, where they may be, for so short an arm"]


def flange_rotation(model: Any, tip: str) -> tuple[FloatArray, str]:
    """Turn a link's frame so that z points away from the arm along the last axis (ISO 9787).

    Parameters
    ----------
    model : pinocchio.Model
    tip : str
        Link of the flange.

    Returns
    -------
    quaternion : array, shape (4,)
        Orientation of the flange in the link's frame, w first.
    note : str
        "" where z does so already.
    """
    outwards = outward_axis(model, tip)
    z = np.array([0.0, 0.0, 1.0])
    if outwards is None or outwards[2] > ALONG_AXIS or np.abs(outwards).max() < ALONG_AXIS:
        return np.array([1.0, 0.0, 0.0, 0.0]), ""
    quaternion = pinocchio.Quaternion.FromTwoVectors(z, outwards)
    found = np.array([quaternion.w, quaternion.x, quaternion.y, quaternion.z])
    letter = "xyz"[int(np.argmax(np.abs(outwards)))]
    sign = "-" if outwards[np.argmax(np.abs(outwards))] < 0 else ""
    return found, f"flange: {sign}{letter} of link {tip} points away from the arm, taken as its z"


def outward_axis(model: Any, tip: str) -> FloatArray | None:
    """Return where the last axis points away from the arm, in a link's frame, shape (3,).

    Parameters
    ----------
    model : pinocchio.Model
    tip : str
        Link of the flange.

    Returns
    -------
    array or None
        A unit vector; None where neither way along the axis leads away.
    """
    flange = model.frames[model.getFrameId(tip, pinocchio.FrameType.BODY)].placement
    axis = joint_axis(model.joints[model.njoints - 1])[1]
    out = float(axis @ flange.translation)
    if abs(out) < 1e-3:
        # The flange is at the joint: the way that led there points out.
        before = list(model.jointPlacements)[-1]
        out = float(axis @ (before.rotation.T @ before.translation))
    if abs(out) < 1e-3:
        return None
    outwards: FloatArray = flange.rotation.T @ (axis if out >= 0 else -axis)
    return outwards


def find_home(robot: Robot, reach: float) -> tuple[FloatArray, bool]:
    """Search a home: clear, within limits, far from singular, hand ahead, elbow up.

    A random search that narrows around its best (cross-entropy), always with the same numbers.

    Parameters
    ----------
    robot : Robot
    reach : float
        Of the arm, metres.

    Returns
    -------
    home : array, shape (n,)
        rad, whole degrees.
    is_clear : bool
        Whether nothing touches.
    """
    random = np.random.default_rng(0)
    low = np.maximum(robot.limits.position_min, -_WIDEST_RAD)
    high = np.minimum(robot.limits.position_max, _WIDEST_RAD)
    low, high = np.minimum(low, high - 1e-3), np.maximum(high, low + 1e-3)
    span = high - low
    poses = low + span * random.random((_FIRST_CANDIDATES, robot.n))
    poses[0] = np.clip(0.0, low, high)
    best: FloatArray = np.empty((0, robot.n))
    for _ in range(_ROUNDS):
        everyone = np.vstack([best, poses])
        order = np.argsort(_cost(robot, everyone, low, span, reach), kind="stable")
        best = everyone[order[:_BEST]]
        spread = best.std(axis=0) + 1e-3
        parents = best[random.integers(0, len(best) // 2, _CANDIDATES)]
        poses = np.clip(parents + spread * random.normal(size=parents.shape), low, high)
    degrees = np.clip(np.round(np.degrees(best[0])), np.degrees(low), np.degrees(high))
    home = np.radians(degrees)
    return home, bool(distances(robot.chain, home).min() > 0)


def _cost(
    robot: Robot, poses: FloatArray, low: FloatArray, span: FloatArray, reach: float
) -> FloatArray:
    """Rate poses (B, n), the lower the better, shape (B,)."""
    tips = forward_kinematics(robot.chain, poses)
    shoulder = robot.chain.placements[0] @ (robot.chain.placements[1] if robot.n > 1 else np.eye(4))
    way = (tips[:, :3, 3] - shoulder[:3, 3]) / max(reach, 1e-6)
    ahead = np.abs(way - [_AHEAD, 0.0, 0.0]) @ [1.0, 2.0, 1.0]
    # The tool looks ahead, as a hand does.
    looks = 1.0 - tips[:, 0, 2]
    share = (poses - low) / span
    margin = np.minimum(share, 1.0 - share).min(axis=1)
    near = np.maximum(_CLEAR_M - distances(robot.chain, poses).min(axis=1), 0.0) / _CLEAR_M
    cost: FloatArray = (
        ahead
        + looks
        + 2.0 * _nearness_to_singular(robot, poses, reach)
        + 5.0 * np.maximum(_INSIDE - margin, 0.0) / _INSIDE
        + 0.1 * np.abs(poses).mean(axis=1)
        - 0.5 * _elbow_height(robot, poses, tips) / max(reach, 1e-6)
        + np.where(near > 0, 5.0 + np.minimum(near, 10.0), 0.0)
    )
    return cost


def _nearness_to_singular(robot: Robot, poses: FloatArray, reach: float) -> FloatArray:
    """Return 0 where an arm turns and moves in every direction, 1 where in one it does not."""
    least = least_singular_values(robot, poses, reach)
    nearness: FloatArray = np.maximum(1.0 - least / 0.15, 0.0)
    return nearness


def _elbow_height(robot: Robot, poses: FloatArray, tips: FloatArray) -> FloatArray:
    """Return how far the highest joint is above shoulder and tip, shape (B,), metres."""
    frames = np.broadcast_to(np.eye(4), (len(poses), 4, 4))
    heights = []
    for joint in range(robot.n):
        frames = frames @ robot.chain.placements[joint]
        heights.append(frames[:, 2, 3])
        turns = np.broadcast_to(np.eye(4), (len(poses), 4, 4)).copy()
        turns[:, :3, :3] = _rotations(robot.chain.axes[joint], poses[:, joint])
        frames = frames @ turns
    placed = np.stack(heights[1:] or heights, axis=1)
    height: FloatArray = placed.max(axis=1) - np.maximum(placed[:, 0], tips[:, 2, 3])
    return height


def _rotations(axis: FloatArray, angles: FloatArray) -> FloatArray:
    """Return rotations about an axis (3,), shape (B, 3, 3): Rodrigues' formula."""
    cross = np.cross(np.eye(3), axis)
    sine, rest = np.sin(angles)[:, None, None], (1.0 - np.cos(angles))[:, None, None]
    turned: FloatArray = np.eye(3) - sine * cross + rest * (cross @ cross)
    return turned
