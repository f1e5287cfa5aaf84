"""Compile what the default run needs, once: ``python -m besman.pipeline.compile_kernels``.

What is compiled is kept beside the package, or in the user's cache where that is read-only.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np


def compile_kernels() -> None:
    """Call all kernels of the default run, one half in each of two processes."""
    with ProcessPoolExecutor(len(_HALVES), mp_context=get_context("spawn")) as pool:
        for half in [pool.submit(half) for half in _HALVES]:
            half.result()


def _compile_descent() -> None:
    """Kernels that follow a path step by step."""
    from besman.robot.branches import IkWeights, find_branches, joint_box
    from besman.robot.kinematics import forward_kinematics
    from besman.robot.model import load_robot
    from besman.robot.path_refinement import refine_path
    from besman.simulation import no_clock  # noqa: F401
    from besman.stages.map.time_scaling import scale_path

    robot = load_robot("ur5")
    # So fast that the limits ask for another path.
    time = np.linspace(0.0, 0.5, 16)
    positions = robot.home + np.outer(np.sin(2 * np.pi * time), np.ones(robot.n))
    poses = forward_kinematics(robot.chain, positions)
    weights, paces = IkWeights(), (robot.limits.velocity, robot.limits.acceleration)
    find_branches(robot, poses[0], positions[:1], weights, False)
    refine_path(
        robot.chain,
        poses,
        positions,
        joint_box(robot),
        weights.as_array(),
        robot.home,
        False,
        paces,
    )
    # Last: the dynamics that it asks for have come from the other half by then.
    scale_path(robot, time, positions)


def _compile_branches() -> None:
    """Kernels that find names, movements and branches, and those that check an arm's limits."""
    from besman.geometry.low_pass import low_pass
    from besman.robot.branch_choice import choose_candidates
    from besman.robot.branches import IkWeights
    from besman.robot.collision import distances
    from besman.robot.dynamics import inverse_dynamics
    from besman.robot.model import load_robot
    from besman.stages.label.pair_distances import compile_average
    from besman.stages.map.terms import cheapest_terms
    from besman.stages.segment.valley_vmci import find_movements

    robot = load_robot("ur5")
    resting = np.tile(robot.home, (4, 1))
    inverse_dynamics(robot, resting, resting, resting)
    distances(robot.chain, resting)
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, :3, 3] = 0.4, 0.2, 1.0
    choose_candidates(robot, poses, IkWeights(), False, 0.1, 0)
    branch, errors = resting[None, None], np.zeros((1, 1, 4, 2))
    cheapest_terms(robot, branch, errors, poses[None], np.ones(1), np.ones(6))
    time = np.linspace(0.0, 1.0, 100)
    path = np.sin(2 * np.pi * time)[:, None, None] * np.ones((1, 2, 3))
    find_movements(time, path)
    low_pass(path, 100.0, 10.0, 30)
    rows = np.zeros(1, dtype=np.int64)
    compile_average()(rows, rows, rows, rows + 1, rows, path[0], 1, 1)


_HALVES = (_compile_descent, _compile_branches)

if __name__ == "__main__":
    compile_kernels()
