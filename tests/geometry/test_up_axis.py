"""Which way is up, of people made of sticks, in frames turned by hand."""

import numpy as np
import pytest

from besman.geometry.up_axis import AXES, CLEAR, find_up_axis

RNG = np.random.default_rng(0)
HEIGHTS = {
    "S1:Head": 1.7, "S1:LSHO": 1.45, "S1:RSHO": 1.45, "S1:C7": 1.5, "S1:LELB": 1.1, "S1:Hips": 1.0,
    "S1:LKNE": 0.5, "S1:RKNE": 0.5, "S1:LANK": 0.1, "S1:RightToe": 0.03,
}  # fmt: skip


def unit(axis):
    vector = np.zeros(3)
    vector["xyz".index(axis[-1])] = -1.0 if axis[0] == "-" else 1.0
    return vector


def in_frame(positions, axis):
    """Turn positions with z up into a frame in which an axis points up, by a rotation."""
    up = unit(axis)
    first = np.roll(np.abs(up), 1)
    return positions @ np.stack([first, np.cross(up, first), up])


def person(n_samples=200, walks=True):
    time = np.arange(n_samples) / 100
    positions = np.zeros((n_samples, len(HEIGHTS), 3))
    positions[..., :2] = RNG.normal(scale=0.15, size=(len(HEIGHTS), 2))
    positions[..., 2] = [*HEIGHTS.values()]
    if walks:
        positions[..., 0] += 0.8 * time[:, None] - 1.0
        positions[..., 1] -= 1.5
    return positions + RNG.normal(scale=1e-3, size=positions.shape)


@pytest.mark.parametrize("axis", AXES)
def test_a_person_stands(axis):
    positions = in_frame(person(), axis)
    found = find_up_axis(positions, list(HEIGHTS), 100.0)
    assert (found.axis, found.told_by) == (axis, "names of body parts and the floor")
    assert found.confidence >= CLEAR
    unnamed = find_up_axis(positions, [None] * len(HEIGHTS), 100.0)
    assert (unnamed.axis, unnamed.told_by) == (axis, "the floor")
    # Above no floor the names tell alone.
    lifted = find_up_axis(positions + 5.0 * unit(axis), list(HEIGHTS), 100.0)
    assert (lifted.axis, lifted.told_by) == (axis, "names of body parts")


@pytest.mark.parametrize("axis", AXES)
def test_a_flight(axis):
    time = np.arange(60) / 100
    positions = np.full((100, 2, 3), np.nan)
    positions[20:80, 0] = np.stack([3.0 * time, -time, 1.0 + 2.5 * time - 4.905 * time**2], 1)
    positions[:, 1] = 0.3 * np.sin(np.arange(100) / 20)[:, None]
    found = find_up_axis(in_frame(positions, axis), (None, None), 100.0)
    assert (found.axis, found.told_by) == (axis, "gravity in a flight")
    assert found.confidence >= CLEAR
    # On the moon nothing is known to fall.
    positions[20:80, 0, 2] = 1.0 + 2.5 * time - 0.8 * time**2
    assert find_up_axis(in_frame(positions, axis), (None, None), 100.0).confidence == 0.0


@pytest.mark.parametrize("usual", ["z", "y"])
def test_who_lies_all_the_time_contradicts_the_floor(usual):
    lying = person(walks=False)[..., [2, 0, 1]] + [0.3, 0.0, 0.0]
    lying[..., 2] = np.abs(lying[..., 2]) + 0.02
    found = find_up_axis(lying, list(HEIGHTS), 100.0, usual)
    assert found.axis == usual
    assert found.confidence < CLEAR
    assert "contradict" in found.told_by


@pytest.mark.parametrize("axis", AXES)
def test_an_arm_alone_is_likely_and_no_more(axis):
    names = ["right_shoulder", "elbow_right", "hand"]
    positions = np.array([[0.0, 0.0, 0.4], [0.1, 0.05, 0.1], [0.4, 0.2, 0.1]]) + np.zeros(
        (50, 1, 1)
    )
    found = find_up_axis(in_frame(positions, axis), names, 100.0)
    assert (found.axis, found.told_by) == (axis, "the shoulder above the elbow")
    assert 0.75 <= found.confidence < CLEAR


def test_what_tells_nothing_is_as_usual():
    random = RNG.normal(size=(50, 3, 3))
    for positions in (random, np.full((50, 3, 3), np.nan), random[:1], np.zeros((0, 3, 3))):
        for usual in ("z", "-y"):
            assert find_up_axis(positions, ("a", None, "b"), 100.0, usual) == (usual, 0.0, "")


def test_an_arm_above_a_plane_by_chance_is_not_turned():
    """Eight points without a name, all within a metre on one side of the frame's origin."""
    positions = RNG.uniform([-0.6, -1.1, 0.7], [0.2, -0.05, 1.5], size=(1, 8, 3)) + np.zeros(
        (50, 1, 1)
    )
    assert find_up_axis(positions, (None,) * 8, 60.0) == ("z", 0.0, "")
