"""A small recording as a file of each format."""

import importlib.util

import numpy as np
from foreign_recordings import WRITERS
from ros_bags import write_poses

from besman.io.recordings.exoskeleton import write_joint_log
from besman.io.recordings.formats import FORMATS
from besman.io.recordings.mvnx import write_mvnx
from besman.records import Recording

HAS_ROSBAGS = importlib.util.find_spec("rosbags") is not None
HAD = [one for one in FORMATS if one.name != "ROS bag" or HAS_ROSBAGS]
JOINTS = [
    f"right_{joint}"
    for joint in ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow_pitch", "forearm_roll",
                  "wrist_pitch")
]  # fmt: skip


def recording_of(names=("hand_top", "elbow", "back_top"), gaps=False, n_samples=12):
    random = np.random.default_rng(0)
    time = (4 + np.arange(n_samples)) / 50
    starts, ways = random.normal(size=(2, len(names), 3))
    # As large as a person, whom formats without units are told by.
    starts[0] = [0.0, 0.0, 1.7]
    starts[1:] *= 0.2
    positions = starts + 0.1 * ways * np.sin(5 * time)[:, None, None]
    if gaps:
        positions[3:5, 1] = positions[:2, 0] = np.nan
    return Recording(time, positions, names, 50.0, "x", first_frame=5)


def write_log(recording, path):
    """Write an exoskeleton's log: its angles are the recording's coordinates."""
    angles = recording.positions.reshape(len(recording.time), -1)[:, : len(JOINTS)]
    bodies = {"shoulder": "right_shoulder", "wrist": "right_wrist"}
    write_joint_log(path, recording.time, angles, JOINTS, "dual_arm_example", bodies)


# What writes a sample of a format that cannot hold just any recording.
LOG = "joint log (CSV with '# urdf' and '# frames')"
SAMPLES = {"Xsens MVNX": write_mvnx, LOG: write_log, "ROS bag": write_poses, **WRITERS}


def write_to(entry, recording, path):
    (SAMPLES.get(entry.name) or entry.write)(recording, path)
    return path


def write_sample(entry, path, n_samples=12):
    return write_to(entry, recording_of(n_samples=n_samples), path)
