"""Inverse kinematics in poses a second, beside mink and Pinocchio, measured in one run.

The same 20 paths of 100 poses for the UR5 and the iiwa 7 with their stick holders, full
orientation, warm-started from the pose before; a pose is met where the error's six entries (m and
rad) are no longer than 1e-4, for all. One thread, by its CPU time. mink is used if it is installed
(``pip install mink daqp``). Then
all eight branches in closed form, the best sequence of them over each path, and whole paths as
stage ``map`` solves them, also with the spin about the tool left free.

    python benchmarks/inverse_kinematics.py
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pinocchio
from scipy.spatial.transform import Rotation

from besman.robot.branch_sequence import choose_sequences
from besman.robot.inverse_kinematics import (
    IkWeights,
    find_branches,
    follow_all,
    joint_box,
    solve_path,
)
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot, load_robot
from besman.robot.ur_kinematics import read_geometry, solve_branches
from besman.stages.map.demonstration import pose_errors

N_PATHS, N_POSES = 20, 100
TOLERANCE_M = 1e-4
# Of the six joints of an arm nothing is left open; a stronger pull towards home is an error.
WEIGHTS = IkWeights(home=1e-5)


def make_paths() -> np.ndarray:
    """Forward pushes that bend and turn, poses (20, 100, 4, 4)."""
    rng = np.random.default_rng(0)
    u = np.linspace(0, 1, N_POSES)
    u = 10 * u**3 - 15 * u**4 + 6 * u**5
    paths = np.tile(np.eye(4), (N_PATHS, N_POSES, 1, 1))
    for path in paths:
        start = np.array([0.2, -0.4, 1.3]) + rng.normal(0, 0.03, 3)
        way = np.array([0.35, 0.1, 0.15]) + rng.normal(0, 0.03, 3)
        path[:, :3, 3] = start + np.outer(u, way)
        pitch = np.radians(60 + 40 * u) + rng.normal(0, 0.05)
        path[:, :3, :3] = Rotation.from_rotvec(np.outer(pitch, [0, 1, 0])).as_matrix()
    return paths


def with_besman(robot: Robot, targets: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Levenberg-Marquardt, to the same accuracy as the others."""
    paths, _ = follow_all(
        robot, targets[None], start[None], 0, WEIGHTS, False, rounds=100, tolerance=1e-3,
        enough=TOLERANCE_M,
    )  # fmt: skip
    return paths[0, 0]


def with_pinocchio(robot: Robot, targets: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Damped least squares as in Pinocchio's own example."""
    data, angles, answers = robot.model.createData(), start.copy(), []
    for target in targets:
        goal = pinocchio.SE3(target)
        for _ in range(100):
            pinocchio.framesForwardKinematics(robot.model, data, angles)
            error = pinocchio.log6(data.oMf[robot.tip_frame].actInv(goal)).vector
            if np.linalg.norm(error) < TOLERANCE_M:
                break
            jacobian = pinocchio.computeFrameJacobian(robot.model, data, angles, robot.tip_frame)
            square = jacobian @ jacobian.T + 1e-6 * np.eye(6)
            angles = angles + jacobian.T @ np.linalg.solve(square, error)
        answers.append(angles)
    return np.array(answers)


def make_mink(robot: Robot) -> Callable[[Robot, np.ndarray, np.ndarray], np.ndarray] | None:
    """Set up mink on the MuJoCo model of the same arm."""
    try:
        import mink
    except ImportError:
        return None
    from besman.robot.mujoco_model import arm_spec

    spec, _ = arm_spec(robot, 0.001)
    configuration = mink.Configuration(spec.compile())
    task = mink.FrameTask("tcp", "site", position_cost=1.0, orientation_cost=1.0, lm_damping=1e-6)

    def solve(robot: Robot, targets: np.ndarray, start: np.ndarray) -> np.ndarray:
        configuration.update(start)
        answers = []
        for target in targets:
            task.set_target(mink.SE3.from_matrix(target))
            for _ in range(100):
                if np.linalg.norm(task.compute_error(configuration)) < TOLERANCE_M:
                    break
                velocity = mink.solve_ik(configuration, [task], 1.0, solver="daqp", damping=1e-9)
                configuration.integrate_inplace(velocity, 1.0)
            answers.append(configuration.q.copy())
        return np.array(answers)

    return solve


def with_branches(robot: Robot, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All eight branches of every pose in closed form."""
    geometry = read_geometry(robot.chain)
    assert geometry is not None
    return solve_branches(geometry, targets, *joint_box(robot), robot.home)


def with_sequence(robot: Robot, targets: np.ndarray) -> np.ndarray:
    """The best sequence of the branches in closed form."""
    found, valid = with_branches(robot, targets)
    costs = np.where(valid, 0.0, np.inf)
    reach = robot.limits.velocity / N_POSES
    return choose_sequences(found, costs, reach, *joint_box(robot), robot.home, 1)[0]


def measure(solve: Callable[[np.ndarray], object], paths: np.ndarray) -> float:
    """Return poses a second, the best of three."""
    solve(paths[0])
    best = np.inf
    for _ in range(3):
        begin = time.thread_time()
        for path in paths:
            solve(path)
        best = min(best, time.thread_time() - begin)
    return N_PATHS * N_POSES / best


def report_whole_paths(robot: Robot, paths: np.ndarray) -> None:
    """Print the speed of branches, of their sequence and of whole paths."""
    print(f"{'all 8 branches':>16} {measure(lambda path: with_branches(robot, path), paths):10.0f}")
    print(f"{'best sequence':>16} {measure(lambda path: with_sequence(robot, path), paths):10.0f}")
    for name in ("ur5", "compi"):
        arm = load_robot(name, "stick_holder")
        for free in (False, True):
            speed = measure(lambda path: solve_path(arm, path, free_spin=free), paths)  # noqa: B023
            spent = 1000 * N_POSES / speed
            print(f"whole path, {name}{', free spin' if free else ''}: {spent:.0f} ms")


def compare(name: str, paths: np.ndarray) -> dict[str, float]:
    """Print the speeds of all methods on one arm, best of three; return the ratios."""
    robot = load_robot(name, "stick_holder")
    starts = [
        find_branches(robot, path[0], robot.home[None], IkWeights(), False)[0] for path in paths
    ]
    methods = {"besman": with_besman, "pinocchio loop": with_pinocchio}
    mink = make_mink(robot)
    if mink is not None:
        methods["mink"] = mink
    speeds = {}
    print(f"{name}, {robot.n} joints {'poses/s':>13} {'worst error':>12}")
    for method_name, method in methods.items():
        method(robot, paths[0], starts[0])
        best, worst, turned = np.inf, 0.0, 0.0
        for _ in range(3):
            begin = time.thread_time()
            answers = [
                method(robot, path, start) for path, start in zip(paths, starts, strict=True)
            ]
            best = min(best, time.thread_time() - begin)
        for path, answer in zip(paths, answers, strict=True):
            off, turn = pose_errors(forward_kinematics(robot.chain, answer), path)
            worst, turned = max(worst, float(off.max())), max(turned, float(turn.max()))
        speeds[method_name] = N_PATHS * N_POSES / best
        print(f"{method_name:>16} {speeds[method_name]:10.0f} {worst * 1000:9.3f} mm"
              f"{turned * 1000:9.3f} mrad")  # fmt: skip
    ratios = {one: speeds["besman"] / speed for one, speed in speeds.items() if one != "besman"}
    for method_name, ratio in ratios.items():
        print(f"besman : {method_name} = {ratio:.0f} : 1")
    return ratios


def main() -> None:
    paths = make_paths()
    for name in ("ur5", "iiwa7"):
        compare(name, paths)
    report_whole_paths(load_robot("ur5", "stick_holder"), paths)


if __name__ == "__main__":
    main()
