"""Two arms on a frame: both hands hold it, and what they do is an action together."""

import numpy as np
import pytest

from besman.synthetic.body import LEFT, RIGHT
from besman.synthetic.person import draw_person
from besman.synthetic.script import draw_temper
from besman.synthetic.stance import draw_stance, stream
from besman.synthetic.take import Setting, play_plan
from besman.synthetic.two_arms import (
    HELD,
    OBJECT_ROTATION_ACTIONS,
    Pair,
    hold_frame,
    plan_object_rotation,
)


@pytest.fixture(scope="module")
def people():
    rng = np.random.default_rng(7)
    return draw_person(rng), draw_temper(rng), lambda number: stream(5, number + 1)


def test_a_raised_grasp_turns_about_the_middle_of_the_frame(people):
    person, _, streams = people
    pair = Pair(*people)
    middle = person.reach_m * HELD - [0, person.shoulder[1], 0]
    way = [pair.grasp(HELD, 0.4, up, streams(0)).hand - middle for up in (0.0, 30.0, 60.0)]
    np.testing.assert_allclose(
        np.linalg.norm(way, axis=1), 0.4 * person.reach_m, atol=5 * people[1].spread_m
    )
    heights = [one[2] for one in way]
    assert heights == sorted(heights)


def test_both_hands_are_done_at_once(people):
    pair = Pair(*people)
    goal = pair.grasp(HELD, 0.4, 0.0, np.random.default_rng(0))
    begin = pair.begin()
    pair.both({RIGHT: ("lift", goal, 1.0, (0.0, 0, 0)), LEFT: ("hold", None, 1.0, (0.0, 0, 0))},
              {RIGHT: 0.3})  # fmt: skip
    pair.act("lift", begin)
    plan = pair.plan()
    assert plan.arms[RIGHT].end == plan.arms[LEFT].end
    assert [one.label for one in plan.arms[RIGHT].phases] == ["hold", "lift"]
    assert [one.label for one in plan.arms[LEFT].phases] == ["hold"]
    assert plan.actions[0].phases == {RIGHT: (0, 2), LEFT: (0, 1)}


def test_the_frame_is_between_the_hands(people):
    person, temper, streams = people
    plan = plan_object_rotation(person, temper, streams, range(1))
    assert {action.label for action in plan.actions} == set(OBJECT_ROTATION_ACTIONS)
    setting = Setting(50.0, "a", np.random.default_rng(0), things=hold_frame)
    capture = play_plan(person, draw_stance(np.random.default_rng(1)), plan, setting)
    (box,) = capture.boxes
    right, left = (capture.body.hands[side][:, :3] for side in (RIGHT, LEFT))
    np.testing.assert_allclose(box.centre, (right + left) / 2)
    across = np.einsum("ti,ti->t", left - right, box.box2lab[..., 1])
    np.testing.assert_allclose(across, np.linalg.norm(left - right, axis=1))
    np.testing.assert_allclose(np.linalg.det(box.box2lab), 1.0)
