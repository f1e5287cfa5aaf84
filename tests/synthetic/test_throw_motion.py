import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.synthetic.person import (
    JOINT_NAMES,
    draw_person,
    move_arm,
    reach_with,
    see_from_torso,
)
from besman.synthetic.throw_motion import (
    STICK_AXIS_IN_HAND,
    aim_stick,
    draw_rest,
    draw_strokes,
    draw_style,
    move_hand,
    move_torso,
)

# What healthy joints reach, degrees, with the forearm's rotation counted from full pronation.
RANGES = {
    "elbow_flexion": (0, 160),
    "forearm_rotation": (0, 180),
    "wrist_flexion": (-70, 75),
    "wrist_deviation": (-35, 30),
}


def draw(seed: int):
    rng = np.random.default_rng(seed)
    person, style = draw_person(rng), draw_style(rng)
    rest, after = draw_rest(person, style, rng), draw_rest(person, style, rng)
    return person, rest, after, draw_strokes(person, style, after, 0.5, rng)


@pytest.mark.parametrize("seed", range(40))
def test_arm_stays_within_human_ranges(seed):
    person, rest, _, strokes = draw(seed)
    time = np.arange(0, strokes[-1].bell.end + 0.2, 0.01)
    hand, wrist_joints, pole = move_hand(rest, strokes, time)
    torso = Rotation.from_euler("ZY", np.column_stack(move_torso(strokes, time)))
    seen = see_from_torso(person, hand, torso)
    joints = np.rad2deg(reach_with(person, seen, wrist_joints, torso.inv().apply(pole)))
    for name, (low, high) in RANGES.items():
        angles = joints[:, JOINT_NAMES.index(name)]
        assert low <= angles.min() <= angles.max() <= high, name
    assert np.abs(np.diff(joints, axis=0)).max() < 15.0  # 1500 degrees a second: no jumps


@pytest.mark.parametrize("seed", range(5))
def test_hand_passes_from_pose_to_pose(seed):
    _, rest, after, strokes = draw(seed)
    hand, wrist_joints, _ = move_hand(rest, strokes, np.array([0.0, strokes[-1].bell.end]))
    np.testing.assert_allclose(hand, [rest.hand, after.hand], atol=1e-12)
    np.testing.assert_allclose(wrist_joints, [rest.wrist_joints, after.wrist_joints], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_strokes_that_do_not_overlap_are_bells(seed):
    _, rest, _, strokes = draw(seed)
    bell = strokes[0].bell
    time = np.linspace(bell.start, bell.end, 1001)
    hand, _, _ = move_hand(rest, strokes[:1], time)
    speed = np.linalg.norm(np.gradient(hand, time, axis=0), axis=1)
    progress = np.gradient(bell.progress(time), time)
    np.testing.assert_allclose(speed / speed.max(), progress / progress.max(), atol=5e-3)


@pytest.mark.parametrize("seed", range(5))
def test_torso_comes_back(seed):
    *_, strokes = draw(seed)
    twist, lean = move_torso(strokes, np.array([0.0, strokes[-1].bell.end]))
    np.testing.assert_allclose([twist, lean], 0.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_stick_points_up_as_drawn_when_the_throw_begins(seed):
    person, _, _, strokes = draw(seed)
    pose = strokes[0].to
    torso = Rotation.from_euler("ZY", [[strokes[0].twist, strokes[0].lean]])
    seen = see_from_torso(person, pose.hand[np.newaxis], torso)
    joints = reach_with(
        person, seen, pose.wrist_joints[np.newaxis], torso.inv().apply(pose.pole[np.newaxis])
    )
    stick = torso.apply(move_arm(person, joints).hand2torso @ STICK_AXIS_IN_HAND)[0]
    assert 35 < np.rad2deg(np.arcsin(stick[2])) < 60
    assert abs(np.rad2deg(np.arctan2(stick[1], stick[0]))) < 6


@pytest.mark.parametrize("roll", [0.0, 20.0])
def test_aim(roll):
    hand2body = aim_stick(30.0, 10.0, roll)
    stick = hand2body.apply(STICK_AXIS_IN_HAND)
    azimuth, elevation = np.deg2rad([10, 30])
    expected = np.array([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)]) * np.cos(elevation)
    np.testing.assert_allclose(stick, expected)
    thumb = hand2body.apply([0, 1, 0])
    assert thumb[1] > 0.9
    assert hand2body.apply([1, 0, 0])[1] == pytest.approx(np.sin(np.deg2rad(roll)), abs=0.2)
