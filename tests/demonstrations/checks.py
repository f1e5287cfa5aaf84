"""What a joint trajectory violates, found without the functions that were to prevent it."""

from collections import Counter
from functools import cache

import coal
import numpy as np
import pinocchio

from besman.robot.limits import check_limits
from besman.robot.model import Robot

# Of differences of the positions, and of torques and distances by another library.
_ROUNDING = 1e-6
_STEP_S = 1e-3
# Of a number in an exported CSV.
DIGITS = 12


def violations(
    robot: Robot, movement: tuple[np.ndarray, ...], rng: np.random.Generator, looks: int
) -> Counter:
    """Count the samples at 1 kHz that violate something, by kind.

    Parameters
    ----------
    robot : Robot
    movement : (time, positions, velocities, accelerations)
        Shapes (T,) and three of (T, n), s and rad; the last step may be shorter than 1 ms.
    rng : Generator
        Draws the samples for other libraries.
    looks : int
        How many of these.

    Returns
    -------
    Counter
        Without what is not violated.
    """
    time, positions, *_ = movement
    limits = robot.limits
    found = Counter()
    found["not finite"] = sum(int(np.sum(~np.isfinite(part))) for part in movement)
    found["time"] = int(np.sum(~(np.diff(time) > 0)))
    report = check_limits(robot, *(as_exported(part) for part in movement[1:]))
    for kind in ("position", "velocity", "acceleration", "torque", "self_collisions"):
        found[kind] = getattr(report, kind)
    # Of a last step that is shorter, be it by a hair, differences say something else.
    short = len(time) > 1 and time[-1] - time[-2] < (1.0 - _ROUNDING) * _STEP_S
    whole = positions[:-1] if short else positions
    speeds = np.diff(whole, axis=0) / _STEP_S
    found["velocity, by differences"] = _beyond(speeds, limits.velocity)
    pulls = np.diff(speeds, axis=0) / _STEP_S
    found["acceleration, by differences"] = _beyond(pulls, limits.acceleration)
    for row in rng.integers(len(time), size=looks):
        state = [part[row] for part in movement[1:]]
        found["torque, by Pinocchio"] += _beyond(_torques(robot, *state)[None], limits.torque)
        found["touch, by Coal"] += int(not coal_distance(robot, state[0]) > 0)
    return +found


def _beyond(values: np.ndarray, limit: np.ndarray) -> int:
    """Count rows with a value beyond its limit; NaN is."""
    return int(np.sum(~np.all(np.abs(values) <= limit * (1 + _ROUNDING), axis=1)))


def as_exported(values: np.ndarray) -> np.ndarray:
    """Round as `besman.io.exports.write_joint_csv` does."""
    with np.errstate(divide="ignore"):
        digits = np.floor(np.log10(np.abs(values)))
    unit = 10.0 ** (DIGITS - 1 - np.where(np.isfinite(digits), digits, 0.0))
    return np.rint(values * unit) / unit


@cache
def _data(robot: Robot) -> pinocchio.Data:
    return robot.model.createData()


def _torques(robot: Robot, *state: np.ndarray) -> np.ndarray:
    return np.array(pinocchio.rnea(robot.model, _data(robot), *state))


@cache
def _capsules(robot: Robot) -> list[tuple[int, coal.Capsule, pinocchio.SE3]]:
    """Give every capsule of an arm: its joint (-1: none), its shape, and where it is there."""
    chain, found = robot.chain, []
    for joint, (start, end), radius in zip(
        chain.capsule_joints, chain.capsule_ends, chain.capsule_radii, strict=True
    ):
        along = end - start
        turn = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0, 1]), along).matrix()
        shape = coal.Capsule(float(radius), float(np.linalg.norm(along)))
        found.append((int(joint), shape, pinocchio.SE3(turn, (start + end) / 2)))
    return found


def coal_distance(robot: Robot, angles: np.ndarray) -> float:
    """Compute the distance of an arm to itself, its pedestal and the floor, metres."""
    data, chain = _data(robot), robot.chain
    pinocchio.forwardKinematics(robot.model, data, np.array(angles))
    placed, lowest = [], np.inf
    for joint, shape, where in _capsules(robot):
        place = data.oMi[joint + 1] * where if joint >= 0 else where
        placed.append((shape, coal.Transform3s(place.rotation, place.translation)))
        if joint > 0:
            drop = abs(place.rotation[2, 2]) * shape.halfLength + shape.radius
            lowest = min(lowest, place.translation[2] - drop)
    request = coal.DistanceRequest()
    own = (
        coal.distance(*placed[one], *placed[other], request, coal.DistanceResult())
        for one, other in chain.capsule_pairs
    )
    return float(min(lowest, *own))
