"""Poses of links for many samples at once, against Pinocchio sample by sample."""

import numpy as np
import pinocchio
import pytest

from besman.config.resources import find_resource
from besman.exceptions import RecordingError
from besman.io.recordings.exoskeleton_kinematics import (
    frame_id,
    link_poses,
    load_exoskeleton_model,
)

MIXED = """<robot name="a"><link name="base"/><link name="slide"/><link name="wheel"/>
<joint name="p" type="prismatic"><parent link="base"/><child link="slide"/>
<origin xyz="0 0 0.5" rpy="0.3 0 0"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="c" type="continuous"><parent link="slide"/><child link="wheel"/>
<origin xyz="0.1 0 0" rpy="0 0.4 0"/><axis xyz="0 0.6 0.8"/></joint></robot>"""


def by_pinocchio(model, angles, links):
    data = model.createData()
    for sample in range(len(next(iter(angles.values())))):
        q = pinocchio.neutral(model)
        for name, values in angles.items():
            joint = model.joints[model.getJointId(name)]
            value = values[sample]
            q[joint.idx_q : joint.idx_q + joint.nq] = (
                [np.cos(value), np.sin(value)] if joint.nq == 2 else [value]
            )
        pinocchio.framesForwardKinematics(model, data, q)
        yield [data.oMf[frame_id(model, link)] for link in links]


def check(model, angles, links):
    rotations, origins = link_poses(model, angles, links)
    for sample, poses in enumerate(by_pinocchio(model, angles, links)):
        for column, pose in enumerate(poses):
            np.testing.assert_allclose(origins[sample, column], pose.translation, atol=1e-12)
            np.testing.assert_allclose(rotations[sample, column], pose.rotation, atol=1e-12)


def test_the_example_moves_as_pinocchio_moves_it():
    urdf = find_resource("configs/exoskeleton", "dual_arm_example", ".urdf")
    model = load_exoskeleton_model(urdf, urdf)
    rng = np.random.default_rng(0)
    angles = {name: rng.uniform(-1, 1, 6) for name in list(model.names)[1:]}
    check(model, angles, ("right_wrist", "left_forearm", "left_wrist"))


def test_slides_and_endless_hinges_move_too(tmp_path):
    urdf = tmp_path / "a.urdf"
    urdf.write_text(MIXED)
    model = load_exoskeleton_model(urdf, urdf)
    check(model, {"p": np.array([0.2, -0.4]), "c": np.array([0.5, 4.0])}, ("slide", "wheel"))


def test_what_is_no_urdf_names_the_log_too(tmp_path):
    urdf = tmp_path / "a.urdf"
    urdf.write_text("<robot")
    with pytest.raises(RecordingError, match=r"log\.csv: a\.urdf is not a usable URDF: not valid"):
        load_exoskeleton_model(urdf, "log.csv")
