"""Capsules against boxes, beside a second library's distances."""

import coal
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.robot.box_gaps import box_gaps


def test_distances_are_those_of_coal():
    rng = np.random.default_rng(0)
    half = np.array([0.05, 0.06, 0.01])
    for _ in range(60):
        ends, radius = rng.uniform(-0.4, 0.4, (2, 3)), rng.uniform(0.01, 0.08)
        box = np.eye(4)
        box[:3, :3] = Rotation.random(random_state=rng).as_matrix()
        box[:3, 3] = rng.normal(size=3) / 5
        way = ends[1] - ends[0]
        turn, _ = Rotation.align_vectors([way / np.linalg.norm(way)], [[0.0, 0.0, 1.0]])
        expected = coal.distance(
            coal.Capsule(radius, np.linalg.norm(way)),
            coal.Transform3s(turn.as_matrix(), ends.mean(axis=0)),
            coal.Box(*(2 * half)),
            coal.Transform3s(box[:3, :3], box[:3, 3]),
            coal.DistanceRequest(),
            coal.DistanceResult(),
        )
        (gap,) = box_gaps(ends[None, None], np.array([radius]), box[None], half[None])[0]
        if expected > 0:
            assert gap == pytest.approx(expected, abs=2e-5)
        else:
            assert gap <= 1e-5


def test_it_is_the_least_of_all_capsules_and_one_inside_is_in_by_its_radius():
    ends = np.array([[[0.3, 0, 0], [0.3, 0, 0.5]], [[0.0, 0, 0], [0.0, 0, 0.001]]])[None]
    boxes = np.stack([np.eye(4), np.eye(4)])
    boxes[1, 0, 3] = 1.0
    gaps = box_gaps(ends, np.array([0.02, 0.03]), boxes, np.full((2, 3), 0.1))
    np.testing.assert_allclose(gaps, [[-0.03, 0.58]], atol=1e-9)
    assert box_gaps(ends, np.array([0.02, 0.03]), boxes[:0], np.empty((0, 3))).shape == (1, 0)
