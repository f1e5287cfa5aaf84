"""One random demonstration tried: kept, or refused and why, and what it violates."""

import re
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from demonstrations.checks import violations
from demonstrations.draws import ROBOTS, Draw, draw

from besman.exceptions import BesmanError
from besman.motion.adapt_plan import retarget_plan
from besman.motion.rollout import sample_plan
from besman.records import JointTrajectory
from besman.robot.dynamics import inverse_dynamics
from besman.robot.limits import LimitReport, resample_trajectory
from besman.stages.imitate.stage import CartesianDmpConfig, ImitateConfig, VelocityDmpConfig
from besman.stages.map.demonstration import check_demonstration, map_one, tool_poses, why_not
from besman.stages.map.needed_stretch import ChangeTolerance
from besman.stages.map.time_scaling import scale_path

PLANS = (
    ImitateConfig(),
    VelocityDmpConfig(method="joint_dmp_velocity"),
    CartesianDmpConfig(method="cartesian_dmp"),
)
# Samples for other libraries, which take half a millisecond each: of every movement of a hand, and
# of one in so many of the others.
_LOOKS, _LOOKED_AT = 3, 16
# Above it gravity alone asks for what no slower movement gives back.
_STATIC_SHARE = 0.998


@dataclass(frozen=True)
class Outcome:
    """What became of a demonstration.

    Attributes
    ----------
    number : int
    robot, kind : str
    reason : str
        Why it was refused, without numbers; empty if it was kept.
    stretch : float
        By how much it was slowed down; NaN if it did not come so far.
    samples : int
        At 1 kHz, looked at.
    found : Counter
        Violations by kind.
    plan : str
        What became of its motion plan: empty if none was made, "kept", or why it was refused.
    words : str
        Of an error that is none of besman's own.
    seconds : float
        Of CPU.
    """

    number: int
    robot: str
    kind: str
    reason: str = ""
    stretch: float = np.nan
    samples: int = 0
    found: Counter = field(default_factory=Counter)
    plan: str = ""
    words: str = ""
    seconds: float = 0.0


def attempt(
    seed: int, number: int, *, hand: bool = True, robots: tuple[str, ...] = ROBOTS
) -> Outcome:
    """Send one demonstration through mapping and limits, or a path of joints through limits alone.

    Parameters
    ----------
    seed, number : int
        See `demonstrations.draws.draw`.
    hand : bool
        From the hand's poses on; else from a path of the joints on, which takes a tenth as long.
    robots : tuple of str
        The arms that take turns.

    Returns
    -------
    Outcome
    """
    started = time.process_time()
    one = draw(seed, number, hand, robots)
    rng = np.random.default_rng([seed, number, 1])
    found: dict = {}
    try:
        found = _from_hand(one, rng) if hand else _from_joints(one, rng)
    except BesmanError as error:
        found = {"reason": reason_of(str(error).partition(": ")[2])}
    except Exception:
        last = " | ".join(traceback.format_exc().splitlines()[-4:])
        found = {"found": Counter({"traceback": 1}), "words": last}
    seconds = time.process_time() - started
    return Outcome(number, one.robot.name, one.kind, seconds=seconds, **found)


def reason_of(words: str) -> str:
    """Leave out of a reason what differs from one demonstration to the next."""
    words = re.sub(r"\([^)]*\)", "", words)
    words = re.sub(r"joint \S+", "a joint", words)
    words = re.sub(r" of (ur|compi|iiwa|rh5)\S*", " of the arm", words)
    words = re.sub(r"-?\d[\d.]*(e-?\d+)?", "N", words)
    return re.split(r"; |, | \[", words)[0].strip()


def _from_hand(one: Draw, rng: np.random.Generator) -> dict:
    """Map a demonstration that stands where it is, and make a plan of some that are kept."""
    check_demonstration(one.path)
    poses = tool_poses(one.path, one.robot)
    trajectory, report = map_one(one.path, poses, one.robot, one.settings)
    reason = why_not(trajectory, report, one.settings)
    stretch = float(trajectory.time_stretch)
    if reason:
        found = _unscaled(one, trajectory, report)
        return {"reason": reason_of(reason), "stretch": stretch, "found": found}
    found, samples = _check(one, trajectory, rng)
    if not trajectory.position_error.max() <= one.settings.greatest_error_m:
        found["position error"] += 1
    plan, planned, more = _plan(one, trajectory, rng)
    return {"stretch": stretch, "samples": samples + more, "found": found + planned, "plan": plan}


def _from_joints(one: Draw, rng: np.random.Generator) -> dict:
    """Bring a path of the joints within limits, where it may touch something all the same."""
    if len(one.time) < 3:
        return {"reason": "expected a demonstration of at least three poses"}
    settings = one.settings
    # One in 80 with a change of the path.
    change = settings.greatest_change_m * (rng.random() < 0.05)
    scaled = scale_path(
        one.robot,
        one.time,
        one.path,
        tolerance=ChangeTolerance(change, settings.greatest_change_rad, settings.free_spin),
        knot_spacing_s=settings.knot_spacing_s,
        least_duration_s=settings.least_duration_s,
    )
    found, samples = _check(one, scaled, rng, _LOOKS * (rng.integers(_LOOKED_AT) == 0))
    reason = ""
    if found.pop("touch, by Coal", 0) + found.pop("self_collisions", 0):
        reason = "the arm touches itself"
    if found["torque"] and _static_share(one, scaled) > _STATIC_SHARE:
        reason = "the weight of arm and tool alone asks for more torque than a joint has"
        found["torque"] = found["torque, by Pinocchio"] = 0
    return {"reason": reason, "stretch": scaled.stretch, "samples": samples, "found": +found}


def _check(one: Draw, path, rng: np.random.Generator, looks: int = _LOOKS) -> tuple[Counter, int]:
    """Count what a path violates at 1 kHz, and the samples."""
    dense = resample_trajectory(path.time, path.positions, path.velocities, path.accelerations)
    return violations(one.robot, dense, rng, looks), len(dense[0])


def _static_share(one: Draw, path) -> float:
    """Return the greatest share of the torques that gravity alone asks for at 1 kHz."""
    _, positions, *_ = resample_trajectory(
        path.time, path.positions, path.velocities, path.accelerations
    )
    still = np.zeros_like(positions)
    load = np.abs(inverse_dynamics(one.robot, positions, still, still))
    return float(np.max(load / one.robot.limits.torque))


def _unscaled(one: Draw, trajectory: JointTrajectory, report: LimitReport) -> Counter:
    """Count limits that even a refused demonstration must keep: time and knots see to them."""
    kinds = ("position", "velocity", "acceleration")
    found = Counter({f"{kind}, refused": getattr(report, kind) for kind in kinds})
    if report.torque and _static_share(one, trajectory) <= _STATIC_SHARE:
        found["torque, refused"] = report.torque
    return +found


def _plan(
    one: Draw, trajectory: JointTrajectory, rng: np.random.Generator
) -> tuple[str, Counter, int]:
    """Imitate every fourth demonstration and fit the plan to the arm: this is what is exported."""
    if rng.random() >= 0.25:
        return "", Counter(), 0
    kind = PLANS[int(rng.integers(len(PLANS)))]
    try:
        plan = retarget_plan(kind.run((trajectory,), one.robot)[0], one.robot)
    except BesmanError as error:
        return reason_of(str(error).rpartition(f"{trajectory.name}: ")[2]), Counter(), 0
    movement = sample_plan(plan, one.robot)
    found = violations(one.robot, movement, rng, _LOOKS)
    return (
        "kept",
        Counter({f"{key}, of a plan": count for key, count in found.items()}),
        len(movement[0]),
    )
