"""Joint paths to choose from: they reach what they can reach, and a worse one costs more."""

import numpy as np
import pytest

from besman.robot.branch_choice import choose_candidates, rate_paths
from besman.robot.branches import IkWeights
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot

ROBOT = load_robot("ur5", "stick_holder")
WAY = np.array([0.4, -0.2, 0.3, 0.1, -0.2, 0.3])
PATH = ROBOT.home + np.linspace(-0.5, 0.5, 21)[:, None] * WAY
TARGETS = forward_kinematics(ROBOT.chain, PATH)
NONE = np.zeros((len(PATH), 2))


def test_exact_branches_reach_every_pose_and_differ():
    found = choose_candidates(ROBOT, TARGETS, IkWeights(), False, 0.05, 0)
    assert len(found) > 1
    for path in found:
        np.testing.assert_allclose(forward_kinematics(ROBOT.chain, path), TARGETS, atol=1e-6)
        assert np.abs(np.diff(path, axis=0)).max() < 0.2
    nearest = min(np.abs(path - PATH).max() for path in found)
    assert nearest < 1e-5
    apart = [np.abs(a - b).max() for i, a in enumerate(found) for b in found[:i]]
    assert min(apart) > 0.3


def test_a_free_spin_reaches_places_and_the_tools_axis():
    (path, *_) = choose_candidates(ROBOT, TARGETS, IkWeights(), True, 0.05, 0)
    rows = np.unique(np.rint(np.linspace(0, len(PATH) - 1, 16)).astype(int))
    poses = forward_kinematics(ROBOT.chain, path)[rows]
    np.testing.assert_allclose(poses[:, :3, 2:], TARGETS[rows][:, :3, 2:], atol=1e-6)


def test_a_pose_out_of_reach_leaves_what_comes_nearest():
    far = TARGETS.copy()
    far[10:12, :3, 3] *= 3.0
    found = choose_candidates(ROBOT, far, IkWeights(), False, 0.05, 0)
    assert found.shape[1:] == PATH.shape
    assert np.isfinite(found).all()


@pytest.mark.parametrize(
    "worse",
    [
        lambda path, errors: (path, errors + np.array([1e-3, 0.0])),
        lambda path, errors: (path, errors + np.array([0.0, 0.05])),
        lambda path, errors: (path + np.array([0.0, 0, 0, 0, 0, 2.0]), errors),
        lambda path, errors: (path + 0.3 * (np.arange(len(path)) % 2)[:, None], errors),
    ],
    ids=["off", "turned", "away from home", "to and fro"],
)
def test_what_is_worse_costs_more(worse):
    paths, errors = (np.stack(both) for both in zip((PATH, NONE), worse(PATH, NONE), strict=True))
    usual, more = rate_paths(ROBOT, paths, errors, IkWeights(), 0.05)
    assert more > usual
    alone = rate_paths(ROBOT, paths[1:], errors[1:], IkWeights(), 0.05)
    np.testing.assert_allclose(alone, more, rtol=1e-12)


def test_a_path_in_less_time_than_the_arm_needs_costs_more():
    slow, fast = (
        rate_paths(ROBOT, PATH[None], NONE[None], IkWeights(), step_s)[0] for step_s in (1.0, 1e-3)
    )
    assert fast > slow
