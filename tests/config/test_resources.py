"""What robots are called in tables."""

import pytest

from besman.config.resources import robot_title


@pytest.mark.parametrize(
    ("name", "title"),
    [
        ("ur5", "ur5"),
        ("robots/mine/robot.yaml", "mine"),
        ("arms/left.yaml", "left"),
        ("arms/right.yaml", "right"),
        ("robot.yaml", "robot"),
    ],
)
def test_two_arms_in_one_folder_have_two_names(name, title):
    assert robot_title(name) == title
