"""Borders as an annotator sees them, of scripts whose strokes are known."""

import numpy as np
import pytest

from besman.synthetic.bells import Bell
from besman.synthetic.script import ArmScript, Movement, Pause
from besman.synthetic.throw_motion import Pose, Stroke
from besman.synthetic.true_borders import time_parts, time_phases


def pose(x):
    return Pose(np.array([x, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, -1.0]))


def stroke(start, duration, x):
    return Stroke("go", Bell(start, duration), pose(x), np.zeros(3))


def movement(*strokes, parts=False):
    return Movement("go", strokes, parts)


def test_a_movement_is_seen_while_it_has_three_percent_of_its_speed():
    script = ArmScript(
        pose(0.3),
        (Pause("idle", 1.0), movement(stroke(1.0, 1.0, 0.6)), Pause("idle", 3.0)),
        3.0,
    )
    (idle, go, after) = time_phases(script)
    # The bell is u^2 (1 - u)^2: three percent of its peak of 1/16.
    u = 0.5 * (1 - np.sqrt(1 - np.sqrt(0.03)))
    assert go == pytest.approx((1 + u, 2 - u), abs=0.003)
    assert idle == (0.0, go[0])
    assert after == (go[1], 3.0)


def test_movements_that_run_into_each_other_share_the_slowest_moment():
    script = ArmScript(
        pose(0.3), (movement(stroke(0.0, 1.0, 0.6)), movement(stroke(0.8, 1.0, 0.9))), 1.8
    )
    one, two = time_phases(script)
    assert one[1] == two[0] == pytest.approx(0.9, abs=0.002)
    assert one[0] < 0.1
    assert two[1] > 1.7


def test_parts_of_a_movement_meet_where_the_hand_is_slowest():
    both = movement(stroke(0.0, 1.0, 0.6), stroke(0.8, 1.0, 0.9), parts=True)
    borders = time_parts(ArmScript(pose(0.3), (both,), 1.8), both, (0.1, 1.7))
    assert borders == pytest.approx([0.1, 0.9, 1.7], abs=0.002)
