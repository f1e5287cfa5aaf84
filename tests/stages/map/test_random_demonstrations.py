"""Ten thousand random demonstrations on all arms: nothing that is kept violates a limit at 1 kHz.

One in a hundred goes from the hand's poses through inverse kinematics on, the others are paths of
the joints that go through limits alone, which takes a tenth as long.
`benchmarks/random_demonstrations.py` sends any number from the hand on.
"""

from collections import Counter

import numpy as np
import pytest
from demonstrations import attempts, checks
from demonstrations.attempts import attempt, reason_of
from demonstrations.draws import KINDS, ROBOTS, draw

from besman.exceptions import MappingError
from besman.geometry.frames import rotation_to_quaternion
from besman.io.exports import read_joint_csv, write_joint_csv
from besman.robot.collision import distances
from besman.robot.kinematics import manipulability
from besman.robot.limits import resample_trajectory
from besman.robot.model import list_robots, load_robot

SEED, COUNT, BLOCKS = 18, 10_000, 10


@pytest.mark.slow
@pytest.mark.parametrize("block", range(BLOCKS))
def test_nothing_that_is_kept_violates_a_limit(block):
    size = COUNT // BLOCKS
    numbers = range(block * size, (block + 1) * size)
    tried = [attempt(SEED, number, hand=number % 101 == 0) for number in numbers]
    assert [one for one in tried if one.found] == []
    assert {one.robot for one in tried if not one.reason} == set(list_robots())
    assert {one.kind for one in tried} == set(KINDS)
    assert sum(one.samples for one in tried) > 100 * size


def test_a_number_is_one_demonstration():
    for number in range(12):
        hand = draw(3, number, True), draw(3, number, True)
        joints = draw(3, number, False), draw(3, number, False)
        assert np.array_equal(hand[0].path.poses, hand[1].path.poses)
        assert np.array_equal(joints[0].path, joints[1].path)
        assert hand[0].settings == hand[1].settings
        assert hand[0].robot is joints[1].robot


