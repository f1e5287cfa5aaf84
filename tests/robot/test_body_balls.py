import numpy as np
import pytest

from besman.robot.body_balls import group_pairs, place_balls
from besman.robot.nearest_pair import nearest_parts, segment_distance


def random_arm(seed, n_joints=5, n_capsules=14):
    rng = np.random.default_rng(seed)
    joints = np.sort(rng.integers(-1, n_joints, n_capsules))
    ends = rng.uniform(-0.2, 0.2, (n_capsules, 2, 3))
    radii = rng.uniform(0.01, 0.06, n_capsules)
    pairs = [
        (a, b)
        for a in range(n_capsules)
        for b in range(a + 1, n_capsules)
        if joints[b] - joints[a] > 1
    ]
    pairs.sort(key=lambda pair: (joints[pair[0]], joints[pair[1]]))
    return joints, ends, radii, np.array(pairs)


def moved(joints, ends, rng):
    placed = ends.copy()
    for joint in np.unique(joints[joints >= 0]):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        placed[joints == joint] = ends[joints == joint] @ turn.T + rng.uniform(-0.6, 0.6, 3)
    return placed


@pytest.mark.parametrize("seed", range(6))
def test_what_is_passed_over_is_never_the_nearest(seed):
    joints, ends, radii, pairs = random_arm(seed)
    bodies = group_pairs(joints, ends, radii, pairs)
    rng, guess = np.random.default_rng(100 + seed), -1
    for beyond in [np.inf, 0.03] * 10:
        placed = moved(joints, ends, rng)
        gaps = [segment_distance(*placed[a], *placed[b]) - radii[a] - radii[b] for a, b in pairs]
        own, _, guess, _ = nearest_parts(joints, placed, radii, pairs, bodies, guess, beyond, 0)
        assert own == pytest.approx(min(min(gaps), beyond), abs=1e-12)
        assert guess == (int(np.argmin(gaps)) if min(gaps) < beyond else -1)


@pytest.mark.parametrize("seed", range(3))
def test_what_was_far_and_has_not_moved_as_far_is_never_the_nearest(seed):
    """Many pairs: bodies creep, stand still and jump."""
    joints, ends, radii, pairs = random_arm(seed, n_capsules=30)
    bodies = group_pairs(joints, ends, radii, pairs)
    assert len(bodies.memory) > len(pairs) > 150
    rng, guess = np.random.default_rng(200 + seed), -1
    placed = moved(joints, ends, rng)
    for count, beyond in enumerate([np.inf, 0.03] * 15):
        if count % 10 == 9:
            placed = moved(joints, ends, rng)
        elif count % 3:
            for joint in range(5):
                way = rng.uniform(-0.02, 0.02, 3)
                placed[joints == joint] += way
        gaps = [segment_distance(*placed[a], *placed[b]) - radii[a] - radii[b] for a, b in pairs]
        own, _, guess, _ = nearest_parts(joints, placed, radii, pairs, bodies, guess, beyond, 0)
        assert own == pytest.approx(min(min(gaps), beyond), abs=1e-12)
        assert guess == (int(np.argmin(gaps)) if min(gaps) < beyond else -1)


def test_balls_enclose_bodies_wherever_they_are():
    joints, ends, radii, pairs = random_arm(7)
    bodies = group_pairs(joints, ends, radii, pairs)
    placed = moved(joints, ends, np.random.default_rng(8))
    place_balls(placed, bodies)
    for capsule, joint in enumerate(joints):
        for ball in (capsule, len(joints) + joint + 1):
            away = np.linalg.norm(placed[capsule] - bodies.middles[ball], axis=1).max()
            assert away + radii[capsule] <= bodies.reaches[ball] + 1e-12
    assert sorted(set(map(tuple, bodies.runs[:, :2]))) == sorted(map(tuple, bodies.runs[:, :2]))
    np.testing.assert_array_equal(bodies.runs[1:, 2], bodies.runs[:-1, 3])
    assert bodies.runs[-1, 3] == len(pairs)
