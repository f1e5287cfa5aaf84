"""Datasets of an exoskeleton (thesis chapter 8): jerky, joint-limited, logged as joint angles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from besman.geometry.frames import rotation_to_quaternion
from besman.records import Recording
from besman.synthetic.body import LEFT, MIRROR, RIGHT
from besman.synthetic.capture import Capture, JointLog
from besman.synthetic.person import Person, move_arm
from besman.synthetic.reaching import Streams, hanging
from besman.synthetic.script import Temper
from besman.synthetic.take import JointNoise, Plan
from besman.synthetic.two_arms import HELD, Pair

FloatArray = npt.NDArray[np.float64]

URDF = "dual_arm_example"
# What the example's joints are called, in the order of the angles here.
_JOINTS = (
    "shoulder_pitch",
    "shoulder_roll",
    "shoulder_yaw",
    "elbow_pitch",
    "forearm_roll",
    "wrist_pitch",
    "wrist_roll",
)
_LINKS = {"shoulder": "shoulder", "elbow": "forearm", "wrist": "wrist"}
# Its lengths, metres.
_UPPER_ARM_M, _FOREARM_M, _SHOULDER_M = 0.355, 0.386, 0.313


def exoskeleton_person(person: Person) -> Person:
    """Give a person the arm lengths and shoulders of the exoskeleton's robot."""
    shoulder = np.array([0.0, -_SHOULDER_M, person.shoulder[2]])
    return replace(person, upper_arm_m=_UPPER_ARM_M, forearm_m=_FOREARM_M, shoulder=shoulder)


def plan_circle_drawing(
    person: Person, temper: Temper, streams: Streams, repetitions: range
) -> Plan:
    """Draw half a circle up with each hand, and down again (thesis 8.2.2)."""
    pair = Pair(person, temper, streams)
    rest = hanging(person, streams(-1))
    for composer in pair.arms.values():
        composer.pose = composer.start = rest
    pair.rest(1.0)
    radius = 0.26 * temper.amplitude
    middle = np.array([0.58, 0.0, -0.05])
    for repetition in repetitions:
        rng = streams(repetition)
        for composer in pair.arms.values():
            composer.rng = rng
        low, high = (
            pair.grasp(middle + np.array([0.0, 0.0, sign * radius]), 0.12, 0.0, rng)
            for sign in (-1.0, 1.0)
        )
        bulge = (0.0, -radius * person.reach_m, 0.0)
        for label, pose, seconds, bend in (
            ("move_to_start", low, 1.6, (0.0, 0.0, 0.0)),
            ("circle_up", high, 2.2, bulge),
            ("circle_down", low, 2.2, bulge),
            ("move_to_rest", hanging(person, rng), 1.6, (0.0, 0.0, 0.0)),
        ):
            begin = pair.begin()
            pair.both({s: (label, pose, seconds, bend) for s in pair.arms}, {})
            pair.act(label, begin)
        pair.rest(1.2)
    return pair.plan()


def plan_rotation(person: Person, temper: Temper, streams: Streams, repetitions: range) -> Plan:
    """Turn a frame by about 30 degrees and back, both hands on it (thesis 8.2.3)."""
    pair = Pair(person, temper, streams)
    for composer in pair.arms.values():
        composer.pose = composer.start = pair.grasp(HELD, 0.5, 0.0, streams(-1))
    pair.rest(1.0)
    for repetition in repetitions:
        rng = streams(repetition)
        for composer in pair.arms.values():
            composer.rng = rng
        angle = rng.normal(30.0, 2.5)
        for label, up in (("turn_clockwise", angle), ("turn_counterclockwise", 0.0)):
            begin = pair.begin()
            ways = {RIGHT: pair.grasp(HELD, 0.5, -up, rng), LEFT: pair.grasp(HELD, 0.5, up, rng)}
            pair.both({s: (label, ways[s], 1.9, (0.0, 0.0, 0.0)) for s in pair.arms}, {})
            pair.act(label, begin)
        pair.rest(1.0)
    return pair.plan()


_JOINT_LOW_DEG = np.array([-140.0, -80.0, -90.0, 12.0, -95.0, -60.0, -35.0])
_JOINT_HIGH_DEG = np.array([140.0, 80.0, 90.0, 135.0, 150.0, 60.0, 35.0])
_STICTION_HZ = (1.2, 4.0)


def constrain_joints(rng: np.random.Generator) -> JointNoise:
    """Return what an exoskeleton does to a movement: joints that stick, jerk and have limits."""
    amplitude = np.deg2rad(rng.uniform(0.6, 1.3))

    def constrain(joints: FloatArray, rate_hz: float) -> FloatArray:
        band = butter(2, _STICTION_HZ, "bandpass", fs=rate_hz, output="sos")
        noise = sosfiltfilt(band, rng.normal(0.0, 1.0, joints.shape), axis=0)
        noise /= noise.std(axis=0)
        speed = np.abs(np.gradient(joints, 1.0 / rate_hz, axis=0))
        # Nothing sticks where nothing moves.
        share = speed / (speed + np.deg2rad(12.0))
        jerky = joints + amplitude * share * noise
        kept: FloatArray = np.clip(jerky, np.deg2rad(_JOINT_LOW_DEG), np.deg2rad(_JOINT_HIGH_DEG))
        return kept

    return constrain


def log_joints(capture: Capture, person: Person) -> Capture:
    """Turn a capture of markers into a joint log of the example exoskeleton.

    Parameters
    ----------
    capture : Capture
        With its true motion, of a person with the exoskeleton's lengths.
    person : Person

    Returns
    -------
    Capture
        Positions of shoulder, elbow and wrist of both arms in the frame of the exoskeleton's
        root (metres, z up), by forward kinematics from the logged angles, kept within its limits.
    """
    from besman.config.resources import find_resource
    from besman.io.recordings.exoskeleton_kinematics import link_poses, load_exoskeleton_model

    assert capture.body is not None
    urdf = find_resource("configs/exoskeleton", URDF, ".urdf")
    model = load_exoskeleton_model(urdf, urdf)
    angles = {
        f"{side}_{joint}": values
        for side, joints in capture.body.joints.items()
        for joint, values in zip(_JOINTS, _to_hinges(person, joints, side).T, strict=True)
    }
    for name in angles:
        row = model.joints[model.getJointId(name)].idx_q
        low, high = model.lowerPositionLimit[row], model.upperPositionLimit[row]
        angles[name] = np.round(np.clip(angles[name], low, high), 6)
    bodies = {
        f"{side}_{part}": f"{side}_{link}"
        for side in (RIGHT, LEFT)
        for part, link in _LINKS.items()
    }
    recording = capture.recording
    rotations, positions = link_poses(model, angles, tuple(bodies.values()))
    return replace(
        capture,
        recording=Recording(
            time=recording.time,
            positions=positions,
            names=tuple(bodies),
            rate_hz=recording.rate_hz,
            source=recording.source,
            first_frame=recording.first_frame,
            orientations=rotation_to_quaternion(rotations),
        ),
        joint_log=JointLog(URDF, bodies, angles),
    )


def _to_hinges(person: Person, joints: FloatArray, side: str) -> FloatArray:
    """Angles of the example's hinges, shape (T, 7), rad, for angles of a simulated arm.

    At zero the example's arm hangs down with the palm inwards.
    """
    upper = move_arm(person, joints).upper2torso
    if side == LEFT:
        upper = MIRROR @ upper @ MIRROR
    x, y, z = upper[..., 0], upper[..., 1], upper[..., 2]
    shoulder = Rotation.from_matrix(np.stack([z, y, -x], axis=-1)).as_euler("YXZ")
    inwards = 1.0 if side == RIGHT else -1.0
    forearm = inwards * (0.5 * np.pi - joints[:, 4])
    return np.column_stack(
        [
            np.unwrap(shoulder, axis=0),
            -joints[:, 3],
            forearm,
            joints[:, 5],
            inwards * joints[:, 6],
        ]
    )
