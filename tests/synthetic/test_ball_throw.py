from dataclasses import replace

import numpy as np

from besman.synthetic.ball_throw import draw_ball_style
from besman.synthetic.throw_motion import draw_style


def test_skill_throws_faster_with_less_hold():
    styles = [draw_ball_style(np.random.default_rng(seed)) for seed in range(60)]
    plain = [draw_style(np.random.default_rng(seed)) for seed in range(60)]
    gained = np.array([a.speed_mps - b.speed_mps for a, b in zip(styles, plain, strict=True)])
    assert gained.min() >= 0
    assert gained.max() <= 0.5
    holds = np.array([style.hold_s for style in styles])
    # Both come of one number: what is gained in speed is lost in hold.
    np.testing.assert_allclose(holds, 0.25 * (1.0 - 2.0 * gained) - 0.05)


def test_people_differ_more_than_with_a_stick():
    balls = np.array([draw_ball_style(np.random.default_rng(k)).throw_pose for k in range(80)])
    sticks = np.array([draw_style(np.random.default_rng(k)).throw_pose for k in range(80)])
    assert (balls.std(axis=0) > sticks.std(axis=0)).all()
    one = draw_ball_style(np.random.default_rng(5))
    assert replace(one, speed_mps=0.0).speed_mps != one.speed_mps
    again = draw_ball_style(np.random.default_rng(5))
    np.testing.assert_array_equal(one.strike_pose, again.strike_pose)
