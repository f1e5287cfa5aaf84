"""An exoskeleton: its joints stay within their limits, and its log gives its places again."""

import numpy as np
import pytest

from besman.synthetic.body import LEFT, RIGHT
from besman.synthetic.exoskeleton import (
    constrain_joints,
    exoskeleton_person,
    log_joints,
    plan_circle_drawing,
    plan_rotation,
)
from besman.synthetic.person import draw_person
from besman.synthetic.script import draw_temper
from besman.synthetic.stance import draw_stance, stream
from besman.synthetic.take import Setting, play_plan


@pytest.fixture(scope="module")
def people():
    rng = np.random.default_rng(3)
    return (
        exoskeleton_person(draw_person(rng)),
        draw_temper(rng),
        lambda number: stream(9, number + 1),
    )


def test_joints_stick_only_while_they_move_and_keep_their_limits():
    constrain = constrain_joints(np.random.default_rng(0))
    still = np.zeros((400, 7)) + np.deg2rad([0, 0, 0, 60, 0, 0, 0])
    np.testing.assert_allclose(constrain(still, 100.0), still, atol=1e-9)
    moving = still + np.deg2rad(np.linspace(0, 200, 400))[:, None]
    got = np.rad2deg(constrain(moving, 100.0))
    assert (got.max(axis=0) < np.array([140, 80, 90, 135, 150, 60, 35]) + 1e-9).all()
    free = np.rad2deg(moving)[:, 0] < 130
    assert 0.2 < (got[free, 0] - np.rad2deg(moving)[free, 0]).std() < 3.0


def test_the_log_of_the_joints_gives_the_arm_that_moved(people):
    person, temper, streams = people
    plan = plan_rotation(person, temper, streams, range(1))
    setting = Setting(50.0, "a.csv", np.random.default_rng(0))
    capture = play_plan(person, draw_stance(np.random.default_rng(1)), plan, setting)
    logged = log_joints(capture, person)
    assert len(logged.joint_log.angles) == 14
    names = logged.recording.names
    places = {name: logged.recording.positions[:, k] for k, name in enumerate(names)}
    for side in (RIGHT, LEFT):
        truth = {
            part: capture.body.parts[f"{side}_{limb}"][0]
            for part, limb in (("shoulder", "upper_arm"), ("elbow", "forearm"), ("wrist", "hand"))
        }
        for a, b in (("shoulder", "elbow"), ("elbow", "wrist"), ("shoulder", "wrist")):
            expected = np.linalg.norm(truth[a] - truth[b], axis=1)
            found = np.linalg.norm(places[f"{side}_{a}"] - places[f"{side}_{b}"], axis=1)
            np.testing.assert_allclose(found, expected, atol=2e-3)


def test_circles_are_drawn_by_both_hands(people):
    plan = plan_circle_drawing(*people, range(2))
    order = ["move_to_start", "circle_up", "circle_down", "move_to_rest"]
    assert [action.label for action in plan.actions] == order * 2
    assert plan.arms[RIGHT].end == plan.arms[LEFT].end
