"""Goals held against what was learnt (synthetic): what cannot be is said, each in one line."""

import dataclasses

import numpy as np
import pytest
from whole_task import learn_both

from besman.exceptions import PlanError
from besman.planning.block_effects import learn_blocks
from besman.planning.goals import parse_goals, parse_start
from besman.planning.order_search import find_order
from besman.planning.planned_run import plan_goals, split_legs
from besman.planning.problem import explain_no_order, pose_problem


def plan(goal, start="", learnt=None):
    learnt = learnt or learn_both()
    return plan_goals("p", parse_goals(goal), parse_start(start) if start else (), learnt)


def labels(goal, start=""):
    learnt = learn_both()
    posed = pose_problem(parse_goals(goal), parse_start(start) if start else (), learnt)
    steps = find_order(posed.problem).steps
    return [[learnt.blocks[s.block].label for s in leg] for leg in split_legs(steps, learnt)]


TO_TABLE = ["approach_forward", "move_obj_table", "move_to_rest_right"]
TO_SHELF = ["approach_right", "move_obj_shelf", "move_to_rest_down"]


def test_orders_that_were_shown_and_orders_that_were_not():
    assert labels("box1 on table") == [TO_TABLE]
    assert labels("box1 on table at x=0,y=-0.6; box1 on shelf") == [TO_TABLE, TO_SHELF]
    assert labels("box1 on table at x=0,y=-0.6; box1 on table at x=0.2,y=-0.6") == [
        TO_TABLE, ["approach_right", *TO_TABLE[1:]]
    ]  # fmt: skip
    # Where it stands on the table was left open.
    assert labels("box1 on table at x=0,y=-0.6; box1 on table") == [TO_TABLE]
    assert labels("box1 on shelf at x=0.5,y=-0.3") == [
        ["approach_forward", "move_obj_shelf", "move_to_rest_down"]
    ]
    two = "box1 on shelf; box2 on table"
    assert labels("box2 on shelf at x=0.5,y=0 and box1 on table at x=0.1,y=-0.6", two) in (
        [TO_TABLE, TO_SHELF], [TO_SHELF, TO_TABLE],
    )  # fmt: skip


def test_a_heading_that_is_open_is_as_shown_or_turned_about_the_arm():
    learnt = learn_both()
    shown = learnt.places[1].pose
    turn = 0.3
    x, y = shown[:2]
    xy = np.array([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)])
    goal = parse_goals(f"box1 on table at x={xy[0]:.6f},y={xy[1]:.6f}")
    posed = pose_problem(goal, (), learnt)
    turned, kept = posed.spots[-1].poses
    np.testing.assert_allclose(kept, [*xy, *shown[2:]], atol=1e-6)
    angle = 2 * np.arctan2(shown[6], shown[3]) + turn
    expected = [np.cos(angle / 2), 0, 0, np.sin(angle / 2)]
    assert abs(turned[3:] @ expected) == pytest.approx(1.0, abs=1e-9)
    said = parse_goals("box1 on table at x=0,y=0.5,yaw_deg=90")
    (only,) = pose_problem(said, (), learnt).spots[-1].poses
    np.testing.assert_allclose(only[3:], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])


@pytest.mark.parametrize(
    ("goal", "start", "message"),
    [
        (
            "box1 on tabel",
            "",
            r"box1 on tabel: no place 'tabel'; did you mean 'table'\? allowed.*; a run knows the",
        ),
        ("box1 on shelf", "box1 on shef", r"no place 'shef'; did you mean 'shelf'"),
        (
            "bax1 on table",
            "",
            r"no object 'bax1'; did you mean 'box'\? allowed: box, with a number",
        ),
        ("box1 on table", "bix1 on shelf", r"no object 'bix1'; did you mean 'box'"),
        (
            "box2 on table",
            "",
            r"no object 'box2'; did you mean 'box1'\? .* --start 'box1 on PLACE; box2 on PLACE'",
        ),
        (
            "box1 on box2",
            "box1 on shelf; box2 on table",
            r"box1 on box2: nobody has shown how to put something on top of box2; places: shelf",
        ),
        (
            "box1 on table",
            "box1 on shelf; box2 on shelf",
            r"the start: box2 on shelf: box1 stands there \(box1 on shelf\); expected a place besi",
        ),
        (
            "box1 on table at x=0.5,y=0.52",
            "box1 on shelf; box2 on table at x=0.5,y=0.5",
            r"box1 on table at x=0.5,y=0.52: box2 stands there|box2 .*: box1 stands there",
        ),
        (
            "box2 on table at x=0,y=0.5; box1 on table at x=0,y=0.5",
            "box1 on shelf; box2 on table at x=0.5,y=0.5",
            r"box1 stands there \(box1 on table at x=0,y=0.5\)",
        ),
        ("box1 on shelf", "", r"box1 on shelf: holds already, there is nothing to do"),
        (
            "box1 on table at x=5,y=0",
            "",
            r"move_obj_table: its goal at the target 'box1' is out of reach of iiwa7 by \d+ mm",
        ),
    ],
)
def test_what_cannot_be_is_said(goal, start, message):
    with pytest.raises(PlanError, match=message):
        plan(goal, start)


def without(*left_out):
    """What is learnt of the same tasks, if some blocks were never shown."""
    learnt = learn_both()
    blocks = tuple(one for one in learnt.blocks if one.label not in left_out)
    return dataclasses.replace(learnt, blocks=blocks)


@pytest.mark.parametrize(
    ("left_out", "goal", "message"),
    [
        (
            ("move_obj_table",),
            "box1 on table",
            r"no block puts a box on table; blocks put it on: sh",
        ),
        (
            ("approach_right",),
            "box1 on table; box1 on shelf",
            r"box1 on shelf: no block takes something from table; blocks take it from: shelf",
        ),
        (
            ("move_to_rest_right", "move_to_rest_down"),
            "box1 on table",
            "all goals can be reached, but no block brings the hand back to rest",
        ),
    ],
)
def test_what_was_never_shown_is_named(left_out, goal, message):
    with pytest.raises(PlanError, match=message):
        plan(goal, learnt=without(*left_out))


def test_two_boxes_that_are_in_each_others_way_are_said():
    learnt = learn_both()
    goal = parse_goals("box1 on table and box2 on shelf")
    start = parse_start("box1 on shelf; box2 on table")
    posed = pose_problem(goal, start, learnt)
    order = find_order(posed.problem)
    assert order.steps is None
    said = explain_no_order(posed, order, learnt)
    assert said.startswith("box1 on table and box2 on shelf: no order of approach_forward, ")
    assert said.endswith("leads there")


def test_blocks_of_two_places_are_learnt_apart():
    uses = tuple(use for block in learn_both().blocks for use in block.uses)
    assert len(learn_blocks(uses, [0, 1, -1, 1, 0, -1])) == 6
