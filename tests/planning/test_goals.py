"""Goals as a user types them, and what is said of those that are none."""

import pytest

from besman.exceptions import ConfigError, PlanError
from besman.planning.goals import Standing, parse_goals, parse_start, read_goals


def test_goals_follow_each_other_and_hold_at_once():
    text = "box1 on table at x=0.4, y=-0.3; box on shelf and box2 on table at y=1,x=2,yaw_deg=-90;"
    first = Standing("box1", "table", (0.4, -0.3))
    both = Standing("box1", "shelf"), Standing("box2", "table", (2.0, 1.0), -90.0)
    assert parse_goals(text) == ((first,), both)
    assert [str(one) for one in (first, *both)] == [
        "box1 on table at x=0.4,y=-0.3",
        "box1 on shelf",
        "box2 on table at x=2,y=1,yaw_deg=-90",
    ]
    assert parse_start("box1 on shelf; box2 on table") == (
        Standing("box1", "shelf"),
        Standing("box2", "table"),
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"no goal: expected OBJECT on PLACE"),
        ("box1", r"got 'box1'; expected OBJECT on PLACE"),
        ("box1 on table;; box1 on shelf", r"got ''; expected OBJECT on PLACE"),
        ("box1 on table at x=1", r"expected both x and y, got x"),
        ("box1 on table at x=1,y=2,z=3", r"got 'z=3'; allowed: x, y, yaw_deg"),
        ("box1 on table at x=1,y=2,yaw_de=3", r"got 'yaw_de=3'; did you mean 'yaw_deg'"),
        ("box1 on table at x=1,x=2", r"x is there twice"),
        ("box1 on table at x=1,y=nan", r"y: 'nan' is no decimal number"),
        ("box1 on table at x=1,y=1e9", r"y: got 1e9, expected at most 100"),
        ("box1 on table and box on shelf", r"box1 is there twice in a goal"),
        ("box\x1b on table", r"has the control character U\+001B"),
    ],
)
def test_what_is_no_goal_is_said(text, message):
    with pytest.raises(PlanError, match=message):
        parse_goals(text)


def test_an_object_starts_at_one_place():
    with pytest.raises(PlanError, match="box1 is there twice in the start"):
        parse_start("box1 on table; box1 on shelf")


def test_goals_stand_in_a_file(tmp_path):
    path = tmp_path / "goals.yaml"
    path.write_text("start: [box1 on shelf]\ngoals:\n- box1 on table\n- box1 on shelf\n")
    assert read_goals(path) == ("box1 on shelf", "box1 on table; box1 on shelf")
    path.write_text("goals: []\n")
    with pytest.raises(ConfigError, match="goals"):
        read_goals(path)
    path.write_text("goal: [box1 on table]\n")
    with pytest.raises(ConfigError, match="did you mean 'goals'"):
        read_goals(path)
