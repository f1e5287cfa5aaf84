"""What an arm is told to do: where it comes, when, and that it stays within its reach."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.synthetic.person import draw_person, reach_with
from besman.synthetic.script import (
    Composer,
    Movement,
    Pause,
    draw_temper,
    keep_within_reach,
    play_script,
    pose_at,
)

POLE = (-0.2, -0.8, -0.6)


@pytest.fixture
def person():
    return draw_person(np.random.default_rng(1))


@pytest.fixture
def composer(person):
    rng = np.random.default_rng(2)
    return Composer(
        person, draw_temper(rng), rng, pose_at(person, (0.4, -0.1, -0.1), (30, 0, 0), POLE)
    )


def test_a_pose_is_drawn_in_to_what_the_arm_reaches(person):
    for far, share in ((5.0, 0.93), (0.01, 0.32)):
        pose = pose_at(person, np.array([far, 0, 0]), (90, 0, 0), POLE)
        np.testing.assert_allclose(pose.hand, [share * person.reach_m, 0, 0])
    near = pose_at(person, (0.4, -0.1, 0.0), (90, 0, 0), POLE)
    np.testing.assert_allclose(near.hand, [0.4, -0.1, 0.0])
    np.testing.assert_allclose(near.wrist_joints, [np.pi / 2, 0, 0])


def test_the_hand_comes_to_every_pose_and_rests_where_it_is_told_to(person, composer):
    composer.rest(0.5)
    places = [(0.5, 0.1, 0.0), (0.3, -0.3, 0.2), (0.45, 0.0, -0.2)]
    for number, place in enumerate(places):
        pose = pose_at(person, place, (10 * number, 5, 0), POLE)
        composer.move(f"go_{number}", pose, 0.6, (0.05, 0.0, 0.05), twist_deg=5.0)
        composer.rest(0.4)
    script = composer.script()
    ends = np.array([phase.end for phase in script.phases if isinstance(phase, Pause)])
    hand, wrist, pole, twist = play_script(script, ends)
    np.testing.assert_allclose(hand, [script.start.hand, *places], atol=1e-12)
    np.testing.assert_allclose(np.rad2deg(wrist[1:, 0]), [0, 10, 20], atol=1e-9)
    np.testing.assert_allclose(np.rad2deg(twist), [0, 5, 10, 15], atol=1e-9)
    np.testing.assert_allclose(pole, np.tile(POLE, (4, 1)))
    assert script.end == ends[-1]


def test_a_path_is_walked_without_a_jump_where_strokes_overlap(person, composer):
    for place in ((0.5, 0.1, 0.0), (0.3, -0.3, 0.2), (0.45, 0.0, -0.2)):
        composer.move("go", pose_at(person, place, (0, 0, 0), POLE), 0.5, follow_on=1.0)
    time = np.linspace(0, composer.clock, 4001)
    hand = play_script(composer.script(), time)[0]
    speed = np.linalg.norm(np.diff(hand, axis=0), axis=1) / time[1]
    assert np.abs(np.diff(speed)).max() < 0.05 * speed.max()


def test_who_hesitates_makes_two_strokes_of_one_way(person, composer):
    temper = composer.temper
    composer.temper = type(temper)(**{**vars(temper), "hesitation": 1.0})
    goal = pose_at(person, (0.5, 0.2, 0.1), (0, 0, 0), POLE)
    composer.move("reach", goal, 1.0, may_hesitate=True)
    (movement,) = composer.phases
    assert isinstance(movement, Movement)
    assert movement.parts
    assert len(movement.strokes) == 2
    hand = play_script(composer.script(), np.array([composer.clock]))[0]
    np.testing.assert_allclose(hand, [goal.hand], atol=1e-12)


def test_a_wait_too_short_to_be_seen_leaves_no_phase(composer):
    composer.wait_until(0.1, "hold")
    assert composer.phases == []
    composer.wait_until(0.5, "hold")
    assert composer.phases == [Pause("hold", 0.5)]
    assert composer.clock == 0.5


def test_hands_beyond_the_reach_are_drawn_in_so_that_the_arm_can_be_solved(person):
    rng = np.random.default_rng(0)
    wrist = rng.uniform(-0.5, 0.5, (400, 3))
    direction = rng.normal(size=(400, 3)) * [1, 1, 0.5] + [1.0, 0, 0]
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    hand = direction * rng.uniform(0.4, 1.4, 400)[:, None] * person.reach_m
    kept = keep_within_reach(person, hand, wrist)
    np.testing.assert_allclose(np.cross(kept, hand), 0, atol=1e-9)
    reach_with(person, kept, wrist, np.tile(POLE, (400, 1)))
    # What the arm reaches with ease stays where it is.
    easy = np.linalg.norm(hand, axis=1) < 0.8 * person.reach_m
    np.testing.assert_allclose(kept[easy], hand[easy], atol=0.01 * person.reach_m)
    assert Rotation.from_euler("XYZ", wrist).magnitude().max() > 0.5
