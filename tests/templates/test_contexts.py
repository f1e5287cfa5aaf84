from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from besman.exceptions import RefinementError
from besman.simulation.tasks.kinds import load_task
from besman.templates.contexts import (
    ObjectContext,
    TargetContext,
    context_kind,
    parse_context,
    parse_names,
    parse_region,
)


def test_a_target_is_placed_where_it_is_read(make_plan):
    plan, kind = make_plan(0.54), TargetContext()
    placed = kind.place(plan, ("y", "x"), [0.3, 1.2])
    np.testing.assert_array_equal(placed.target, [1.2, 0.3, 0.0])
    np.testing.assert_array_equal(kind.of(placed, ("x", "y")), [1.2, 0.3])
    np.testing.assert_array_equal(placed.weights, plan.weights)


def test_an_object_is_placed_and_turned(make_plan):
    plan, kind = make_plan(0.54), ObjectContext()
    placed = kind.place(plan, ("x", "z", "turn_deg"), [0.7, 0.4, 30.0])
    np.testing.assert_allclose(placed.goal_pose[:3], [0.7, 0.0, 0.4])
    before, after = (
        Rotation.from_quat(one.goal_pose[3:], scalar_first=True) for one in (plan, placed)
    )
    turned = (after * before.inv()).as_rotvec(degrees=True)
    np.testing.assert_allclose(turned, [0, 0, 30.0], atol=1e-12)
    np.testing.assert_allclose(kind.of(placed, ("x", "y", "z")), [0.7, 0.0, 0.4])


def test_a_start_moves_with_where_the_thing_stands(make_plan):
    poses = np.array([[0.5, 0.1, 1.0, 1, 0, 0, 0], [0.4, 0.1, 0.8, 0, 1.0, 0, 0]])
    plan = replace(make_plan(0.54), start_pose=poses[0], goal_pose=poses[1])
    kind = ObjectContext(("start_pose", "goal_pose"))
    placed = kind.place(plan, ("y", "turn_deg"), [0.3, 90.0])
    np.testing.assert_allclose(kind.of(placed, ("x", "y", "z")), [0.5, 0.3, 1.0])
    # A quarter turn to the left: what was 10 cm nearer is 10 cm to the right.
    np.testing.assert_allclose(placed.goal_pose[:3], [0.5, 0.2, 0.8], atol=1e-12)
    before, after = (
        Rotation.from_quat(one.goal_pose[3:], scalar_first=True) for one in (plan, placed)
    )
    np.testing.assert_allclose(
        (after * before.inv()).as_rotvec(degrees=True), [0, 0, 90], atol=1e-9
    )


def test_the_task_says_what_its_context_is():
    assert isinstance(context_kind(load_task("stick_throw")), TargetContext)
    ball = load_task("ball_throw")
    aimed = ball.model_copy(update={"target_m": None})
    assert isinstance(context_kind(aimed), TargetContext)
    assert ball.target_m
    assert isinstance(context_kind(ball), TargetContext)
    assert ball.aimed_by_plan() == aimed
    assert isinstance(context_kind(load_task("reach")), ObjectContext)
    grasp = load_task("grasp_box")
    free = grasp.model_copy(update={"box": grasp.box.model_copy(update={"place_m": None})})
    fixed = grasp.model_copy(update={"box": grasp.box.model_copy(update={"place_m": (1, 0, 1)})})
    assert isinstance(context_kind(free), ObjectContext)
    with pytest.raises(RefinementError, match=r"task grasp_box: box\.place_m fixes where its thin"):
        context_kind(fixed)
    assert isinstance(context_kind(load_task("pull_lever")), ObjectContext)


def test_names_are_checked():
    kind = TargetContext()
    assert kind.choose(parse_names(None)) == ("x", "y")
    assert kind.choose(parse_names("y, x")) == ("y", "x")
    with pytest.raises(RefinementError, match=r"context: got 'z'; .*allowed: x, y"):
        kind.choose(("x", "z"))
    with pytest.raises(RefinementError, match="context: got 'x' twice"):
        kind.choose(("x", "x"))


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_what_is_written_is_read(x, y):
    read = parse_context(f"y={y!r}, x={x!r}", ("x", "y"))
    np.testing.assert_array_equal(read, [x, y])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x=1", "--context: got 'x=1', y missing; expected x=NUMBER,y=NUMBER"),
        ("", "--context: got '', expected NAME=VALUE"),
        ("x=1,y", "--context: got 'y', expected NAME=VALUE"),
        ("x=1,y=2,z=3", "--context: got 'z'; .*allowed: x, y"),
        ("x=1,x=2,y=1", "--context: got 'x' twice"),
        ("x=1,y=far", "--context: y: got 'far', expected a number"),
        ("x=1_0,y=1", "--context: x: got '1_0', expected a number of at most 1000"),
        ("x=1,y=1e30", "--context: y: got '1e30', expected a number of at most 1000"),
        ("x=nan,y=1", "--context: x: got 'nan', expected a number"),
    ],
)
def test_a_wrong_context_says_so(text, message):
    with pytest.raises(RefinementError, match=message):
        parse_context(text, ("x", "y"))


def test_regions_are_read():
    assert parse_region("y=-0.2:1,x=1:2", ("x", "y")) == {"x": (1.0, 2.0), "y": (-0.2, 1.0)}


@pytest.mark.parametrize("text", ["x=1", "x=2:1", "x=1:1", "x=1:2:3"])
def test_a_region_without_extent_says_so(text):
    with pytest.raises(RefinementError, match=r"--region: x: got '.*', expected LEAST:GREATEST"):
        parse_region(text, ("x", "y"))


def test_a_region_of_words_says_so():
    with pytest.raises(RefinementError, match="--region: x: got 'a', expected a number"):
        parse_region("x=a:b", ("x",))
