"""Plans of one arm that reaches: what they consist of, and that the box goes with the hand."""

import numpy as np
import pytest

from besman.synthetic.body import RIGHT
from besman.synthetic.person import draw_person
from besman.synthetic.reaching import (
    BOX_MARKERS,
    PICK_AND_PLACE_CLASSES,
    STEP_M,
    handle_box,
    plan_pick_and_place,
    plan_step,
)
from besman.synthetic.script import Movement, draw_temper
from besman.synthetic.stance import draw_stance, stream
from besman.synthetic.take import Setting, play_plan


@pytest.fixture(scope="module")
def people():
    rng = np.random.default_rng(7)
    return draw_person(rng), draw_temper(rng), lambda number: stream(5, number + 1)


def test_a_step_pattern_is_walked_up_and_down_again(people):
    plan = plan_step(*people, range(2))
    moves = [phase for phase in plan.arms[RIGHT].phases if isinstance(phase, Movement)]
    assert [one.label for one in moves[:8]] == [
        "right", "up", "right", "up", "down", "left", "down", "left",
    ]  # fmt: skip
    assert [action.label for action in plan.actions] == ["step_up", "step_down"] * 2
    corners = np.array([move.strokes[-1].to.hand for move in moves])
    ways = np.diff(corners, axis=0)
    np.testing.assert_allclose(np.abs(ways).max(axis=1), STEP_M, atol=0.01)
    np.testing.assert_allclose(corners[7], corners[15], atol=0.01)


def test_one_repetition_does_not_depend_on_how_many_there_are(people):
    one, three = (plan_pick_and_place(*people, range(n)).arms[RIGHT] for n in (1, 3))
    for a, b in zip(one.strokes, three.strokes, strict=False):
        np.testing.assert_array_equal(a.to.hand, b.to.hand)
        assert a.bell == b.bell


def test_the_box_goes_with_the_hand_and_stays_where_it_is_put(people):
    person, temper, streams = people
    plan = plan_pick_and_place(person, temper, streams, range(1))
    moves = [one.label for one in plan.arms[RIGHT].phases if isinstance(one, Movement)]
    assert moves == list(PICK_AND_PLACE_CLASSES)
    setting = Setting(100.0, "a", np.random.default_rng(0), things=handle_box)
    capture = play_plan(person, draw_stance(np.random.default_rng(1)), plan, setting)
    (box,), hand = capture.boxes, capture.body.hands[RIGHT][:, :3]
    carried = np.zeros(len(hand), dtype=bool)
    for (start, end), label in zip(capture.segments.bounds, capture.segments.labels, strict=True):
        if label.startswith("move_obj"):
            carried[start + 2 : end - 2] = True
            apart = np.linalg.norm((box.centre - hand)[start + 2 : end - 2], axis=1)
            np.testing.assert_allclose(apart, apart[0], atol=1e-9)
    steps = np.linalg.norm(np.diff(box.centre, axis=0), axis=1)
    assert (steps[carried[1:]].max() > 1e-3) & (steps.sum() > 0.5)
    still = ~carried[1:] & ~carried[:-1]
    assert np.count_nonzero(steps[still] > 1e-6) <= 8  # rounding of the borders to rows
    np.testing.assert_allclose(box.box2lab @ box.box2lab.swapaxes(1, 2), np.eye(3)[None].repeat(len(hand), 0), atol=1e-12)  # fmt: skip  # noqa: E501
    for name, offset in BOX_MARKERS.items():
        np.testing.assert_allclose(capture.body.markers[name], box.centre + box.box2lab @ offset)
