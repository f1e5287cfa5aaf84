"""One demonstration on one arm, given where it is in the arm's world."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from besman.exceptions import MappingError
from besman.geometry.frames import quaternion_to_rotation, rotation_to_quaternion
from besman.records import HandTrajectory, JointTrajectory
from besman.robot.inverse_kinematics import Gaps, IkWeights, solve_path
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import LimitReport, check_limits, resample_trajectory
from besman.robot.model import Robot
from besman.search.in_a_box import Optimizer
from besman.stages.map.needed_stretch import ChangeTolerance
from besman.stages.map.placement import PlacementSearch
from besman.stages.map.terms import TermWeights
from besman.stages.map.time_scaling import ScaledPath, scale_path

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class MappingSettings:
    """How demonstrations are mapped.

    Attributes
    ----------
    terms : TermWeights
        What a good placement is.
    ik : IkWeights
        Position before orientation.
    free_spin : bool
        The rotation about the tool's axis does not matter.
    optimizer, evaluations, yaw, scale, seed
        Of the search for the placement, see `besman.stages.map.placement.PlacementSearch`.
    placement_demonstrations : int
        Demonstrations that are looked at in it.
    correct : bool
        A demonstration that the common placement does not serve gets one of its own.
    knot_spacing_s : float
        Of the joint splines, seconds.
    least_duration_s : float
        Shorter movements are stretched to this duration, seconds.
    greatest_change_m, greatest_change_rad : float
        How far the tool may leave its path so that time is stretched less; see
        `besman.stages.map.time_scaling.scale_path`.
    greatest_error_m : float
        Beyond this position error a demonstration is not transferred, metres.
    """

    terms: TermWeights = field(default_factory=TermWeights)
    ik: IkWeights = field(default_factory=IkWeights)
    free_spin: bool = False
    optimizer: Optimizer = "cma_es"
    evaluations: int = 200
    yaw: bool = True
    scale: tuple[float, float] | None = None
    placement_demonstrations: int = 64
    correct: bool = True
    seed: int = 0
    knot_spacing_s: float = 0.05
    least_duration_s: float = 0.0
    greatest_change_m: float = 0.005
    greatest_change_rad: float = float(np.radians(5.0))
    greatest_error_m: float = 0.05

    @property
    def search(self) -> PlacementSearch:
        """The search for a placement."""
        return PlacementSearch(
            weights=self.terms,
            ik=self.ik,
            free_spin=self.free_spin,
            optimizer=self.optimizer,
            evaluations=self.evaluations,
            yaw=self.yaw,
            scale=self.scale,
            demonstrations=self.placement_demonstrations,
            seed=self.seed,
        )


def check_demonstration(one: HandTrajectory) -> None:
    """Refuse what cannot be mapped at all."""
    if len(one.time) < 3:
        raise MappingError(
            f"{one.name}: expected a demonstration of at least three poses, got {len(one.time)}"
        )
    if not (np.isfinite(one.poses).all() and np.all(np.diff(one.time) > 0)):
        raise MappingError(
            f"{one.name}: expected finite poses and rising times, got NaN or times that fall"
        )
    if np.any(np.linalg.norm(one.poses[:, 3:], axis=1) < 1e-6):
        raise MappingError(f"{one.name}: got a quaternion of zero")


def tool_poses(demonstration: HandTrajectory, robot: Robot) -> FloatArray:
    """Return the poses that the hand asks of the tool centre point, in the back frame.

    Returns
    -------
    array, shape (T, 4, 4)
        Metres.
    """
    hand2back = np.tile(np.eye(4), (len(demonstration.time), 1, 1))
    hand2back[:, :3, :3] = quaternion_to_rotation(demonstration.poses[:, 3:])
    hand2back[:, :3, 3] = demonstration.poses[:, :3]
    poses: FloatArray = hand2back @ tcp_in_hand(demonstration.grasp, robot)
    return poses


def tcp_in_hand(grasp: FloatArray, robot: Robot) -> FloatArray:
    """Return where the tool centre point is in the hand: as was demonstrated, or as the tool is.

    Parameters
    ----------
    grasp : array, shape (7,)
        See `besman.records.HandTrajectory`; NaN where nothing was said.
    robot : Robot

    Returns
    -------
    array, shape (4, 4)
        tcp2hand, metres.
    """
    tcp2hand = np.array(robot.tool.tcp2hand)
    position, turn = grasp[:3], grasp[3:]
    if np.isfinite(position).all():
        tcp2hand[:3, 3] = position
    if np.isfinite(turn).all():
        tcp2hand[:3, :3] = quaternion_to_rotation(turn)
    return tcp2hand


def place_target(target: FloatArray, placement: FloatArray) -> FloatArray:
    """Bring a target into the robot's world; it lies on the floor there, as it did before."""
    placed: FloatArray = placement[:3, :3] @ target + placement[:3, 3]
    placed[2] += 0.0 if np.isnan(placed[2]) else -placed[2]
    return placed


def map_one(
    demonstration: HandTrajectory,
    poses: FloatArray,
    robot: Robot,
    settings: MappingSettings,
    gaps: Gaps | None = None,
) -> tuple[JointTrajectory, LimitReport]:
    """Solve, smooth and slow down one demonstration, and check it at 1 kHz.

    Parameters
    ----------
    demonstration : HandTrajectory
    poses : array, shape (T, 4, 4)
        What it asks of the tool centre point in the robot's world frame, metres.
    robot : Robot
    settings : MappingSettings
    gaps : callable, optional
        As of `besman.robot.inverse_kinematics.solve_path`.

    Returns
    -------
    JointTrajectory, LimitReport
        The target is left open.
    """
    path = solve_path(
        robot,
        poses,
        weights=settings.ik,
        free_spin=settings.free_spin,
        step_s=float(demonstration.time[1] - demonstration.time[0]),
        seed=settings.seed,
        gaps=gaps,
    )
    scaled = scale_path(
        robot,
        demonstration.time,
        path.positions,
        tolerance=ChangeTolerance(
            settings.greatest_change_m, settings.greatest_change_rad, settings.free_spin
        ),
        knot_spacing_s=settings.knot_spacing_s,
        least_duration_s=settings.least_duration_s,
    )
    position_error, orientation_error = pose_errors(
        forward_kinematics(robot.chain, scaled.positions), poses, free_spin=settings.free_spin
    )
    trajectory = JointTrajectory(
        time=scaled.time,
        positions=scaled.positions,
        velocities=scaled.velocities,
        accelerations=scaled.accelerations,
        joint_names=robot.joint_names,
        poses=np.hstack([poses[:, :3, 3], rotation_to_quaternion(poses[:, :3, :3])]),
        position_error=position_error,
        orientation_error=orientation_error,
        time_stretch=scaled.stretch,
        target=np.full(3, np.nan),
        name=demonstration.name,
        label=demonstration.label,
    )
    return trajectory, _check_scaled(robot, scaled)


def _check_scaled(robot: Robot, scaled: ScaledPath) -> LimitReport:
    """Check a scaled path at 1 kHz."""
    _, *dense = resample_trajectory(
        scaled.time, scaled.positions, scaled.velocities, scaled.accelerations
    )
    return check_limits(robot, *dense)


def pose_errors(
    reached: FloatArray, asked: FloatArray, *, free_spin: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Compare poses.

    Parameters
    ----------
    reached, asked : array, shape (T, 4, 4)
        Metres.
    free_spin : bool
        Compare only where the tools point (their z axes).

    Returns
    -------
    position : array, shape (T,)
        Metres.
    orientation : array, shape (T,)
        Radians.
    """
    position: FloatArray = np.linalg.norm(reached[:, :3, 3] - asked[:, :3, 3], axis=1)
    if free_spin:
        first, second = reached[:, :3, 2], asked[:, :3, 2]
        sine = np.linalg.norm(np.cross(first, second), axis=1)
        return position, np.arctan2(sine, np.sum(first * second, axis=1))
    turn = np.swapaxes(asked[:, :3, :3], 1, 2) @ reached[:, :3, :3]
    quaternion = rotation_to_quaternion(turn)
    angle = 2 * np.arctan2(np.linalg.norm(quaternion[:, 1:], axis=1), np.abs(quaternion[:, 0]))
    return position, angle


def why_not(trajectory: JointTrajectory, report: LimitReport, settings: MappingSettings) -> str:
    """Say why a demonstration cannot be transferred; empty if it can."""
    row = int(np.argmax(trajectory.position_error))
    error = float(trajectory.position_error[row])
    if error > settings.greatest_error_m:
        place = ", ".join(f"{value:.2f}" for value in trajectory.poses[row, :3])
        return (
            f"position error {error:.3f} m at {trajectory.time[row]:.2f} s, where the hand is at "
            f"({place}) m; at most greatest_error_m {settings.greatest_error_m:g}"
        )
    if report.self_collisions:
        return f"the arm touches itself, its pedestal or the floor ({report.self_collisions} ms)"
    if report.position:
        return f"a joint exceeds its position limit by {report.position_excess:.3f} rad"
    if report.torque:
        ratio = report.torque_ratio
        share = f"{ratio:.2f} of its limit" if ratio >= 1.005 else "just beyond its limit"
        return f"the weight of arm and tool alone asks for more torque than a joint has ({share})"
    if report.violations:
        return f"limits of speed or acceleration are exceeded in {report.violations} samples"
    return ""
