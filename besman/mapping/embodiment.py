"""Embodiment mapping: demonstrations as joint trajectories that an arm can run.

References
----------
L. Gutzeit: From human movement recordings to robot behavior, thesis, section 7.1.
L. Gutzeit, A. Fabisch, M. Otto, J. H. Metzen, J. Hansen, F. Kirchner, E. A. Kirchner: The BesMan
learning platform for automated robot skill learning, 2018. doi:10.3389/frobt.2018.00043
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from besman.exceptions import MappingError
from besman.frames import quaternion_to_rotation, rotation_to_quaternion
from besman.mapping.placement import (
    ArmPaths,
    Placement,
    PlacementSearch,
    correct_placement,
    find_placement,
)
from besman.mapping.search import Optimizer
from besman.mapping.terms import TermWeights
from besman.mapping.time_scaling import ChangeTolerance, ScaledPath, scale_path
from besman.records import Failure, HandTrajectory, JointTrajectory
from besman.robot.inverse_kinematics import IkWeights, solve_path
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import LimitReport, check_limits, resample
from besman.robot.model import Robot
from besman.work import Notes, Work, failure_of

FloatArray = npt.NDArray[np.float64]

# Half of the work is done in kernels without Python's lock: processes, which take two seconds to
# start, are worth it for so many demonstrations; a placement of its own is ten times the work.
_PROCESSES_FROM = 128
_CORRECTIONS_FROM = 12


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
        Of the search for the placement, see `besman.mapping.placement.PlacementSearch`.
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
        `besman.mapping.time_scaling.scale_path`.
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


@dataclass(frozen=True)
class Correction:
    """A demonstration that has a placement of its own.

    Attributes
    ----------
    name : str
    reason : str
        Why the common placement does not serve.
    shift_m, turn_rad : float
        Distance and rotation between the two, in the middle of the movements.
    scale : float
        Factor by which the movement is made smaller or larger, over the common one.
    """

    name: str
    reason: str
    shift_m: float
    turn_rad: float
    scale: float


@dataclass(frozen=True, eq=False)
class Mapping:
    """All demonstrations of a class in the workspace of one arm.

    Attributes
    ----------
    trajectories : tuple of JointTrajectory
        Those that the arm can run; none violates a limit at 1 kHz.
    placement : array, shape (4, 4)
        Back frame to the robot's world frame, metres.
    failed : tuple of Failure
        Those that it cannot, with the reason.
    terms : dict of float
        Cost terms of the placement.
    limit_violations, self_collisions : int
        Samples at 1 kHz, over all trajectories.
    scale : float
        Factor by which movements were made smaller or larger before.
    corrected : tuple of Correction
        Those of `trajectories` with a placement of their own.
    """

    trajectories: tuple[JointTrajectory, ...]
    placement: FloatArray
    failed: tuple[Failure, ...]
    terms: dict[str, float]
    limit_violations: int
    self_collisions: int
    scale: float = 1.0
    corrected: tuple[Correction, ...] = ()


def map_embodiment(
    demonstrations: tuple[HandTrajectory, ...],
    robot: Robot,
    settings: MappingSettings,
    work: Work = Work(),
) -> Mapping:
    """Map demonstrations to an arm: one placement for all, then joint angles, then time.

    Parameters
    ----------
    demonstrations : tuple of HandTrajectory
        Of one class.
    robot : Robot
        The arm with its tool.
    settings : MappingSettings
    work : Work
        Threads, processes and progress; what cannot be mapped is in the result.

    Returns
    -------
    Mapping

    Raises
    ------
    MappingError
        If there is no demonstration, or none can be transferred.
    """
    if not demonstrations:
        raise MappingError("map: expected at least one demonstration, got none")
    notes = Notes()
    usable = usable_demonstrations(demonstrations, notes)
    height = back_height(usable)
    placement = find_placement(
        [arm_paths(robot, usable)],
        settings.search,
        back_height=height,
        jobs=work.jobs,
        progress=work.part(0.0, 0.6).progress,
    )
    noted = replace(work, notes=notes)
    mapped = map_placed(usable, robot, placement, settings, height, noted.part(0.6, 1.0))
    if work.notes is not None:
        work.notes.add_workers(notes)
    mapping = sort_out(mapped, placement, robot, notes.failures, settings)
    order = {one.name: at for at, one in enumerate(demonstrations)}
    return replace(mapping, failed=tuple(sorted(mapping.failed, key=lambda one: order[one.name])))


def arm_paths(robot: Robot, demonstrations: Sequence[HandTrajectory]) -> ArmPaths:
    """Return what demonstrations ask of an arm."""
    return ArmPaths(robot, [(one.time, tool_poses(one, robot)) for one in demonstrations])


@dataclass(frozen=True, eq=False)
class Mapped:
    """One demonstration on one arm.

    Attributes
    ----------
    trajectory : JointTrajectory
    report : LimitReport
        Of its check at 1 kHz.
    correction : Correction, optional
        Where it has a placement of its own.
    """

    trajectory: JointTrajectory
    report: LimitReport
    correction: Correction | None = None

    @property
    def name(self) -> str:
        """The demonstration's name."""
        return self.trajectory.name


def map_placed(
    demonstrations: Sequence[HandTrajectory],
    robot: Robot,
    placement: Placement,
    settings: MappingSettings,
    back_height: float | None,
    work: Work,
) -> list[Mapped]:
    """Map demonstrations, given the placement of all; move those that it does not serve.

    Parameters
    ----------
    demonstrations : sequence of HandTrajectory
    robot : Robot
    placement : Placement
        The common one.
    settings : MappingSettings
    back_height : float or None
        As in `find_placement`.
    work : Work

    Returns
    -------
    list of Mapped
        Of those that raised no error, in their order.
    """
    one = partial(map_with_placement, placement=placement, robot=robot, settings=settings)
    mapped = work.part(0.0, 0.6).map(one, demonstrations, processes=_PROCESSES_FROM)
    reasons = {each.name: _reason(each.trajectory, each.report, settings) for each in mapped}
    unserved = [one for one in demonstrations if reasons.get(one.name)]
    if settings.correct and unserved:
        own = partial(
            _map_corrected,
            placement=placement,
            robot=robot,
            settings=settings,
            back_height=back_height,
            reasons=reasons,
        )
        # One that fails here keeps the reason it has.
        notes = Notes()
        again = replace(work.part(0.6, 1.0), notes=notes)
        found = again.map(own, unserved, processes=_CORRECTIONS_FROM, some=False)
        if work.notes is not None:
            work.notes.add_workers(notes)
        moved = {each.name: each for each in found}
        mapped = [
            each
            if each.name not in moved or reason_of(moved[each.name], settings)
            else moved[each.name]
            for each in mapped
        ]
    return mapped


def usable_demonstrations(
    demonstrations: tuple[HandTrajectory, ...], notes: Notes
) -> tuple[HandTrajectory, ...]:
    """Leave out and note what cannot be mapped at all."""
    usable = []
    for one in demonstrations:
        try:
            _check(one)
        except MappingError as error:
            notes.failures.append(failure_of(one.name, error))
        else:
            usable.append(one)
    if not usable:
        raise MappingError(
            f"map: none of {len(demonstrations)} demonstrations can be used; {notes.failures[0]}"
        )
    return tuple(usable)


def map_with_placement(
    demonstration: HandTrajectory, placement: Placement, robot: Robot, settings: MappingSettings
) -> Mapped:
    """Map one demonstration, given the placement of all, and bring its target along."""
    placed = placement.apply(tool_poses(demonstration, robot))
    trajectory, report = _map_one(demonstration, placed, robot, settings)
    target = place_target(demonstration.target, placement.pose)
    return Mapped(replace(trajectory, target=target), report)


def _map_corrected(
    demonstration: HandTrajectory,
    placement: Placement,
    robot: Robot,
    settings: MappingSettings,
    back_height: float | None,
    reasons: dict[str, str],
) -> Mapped:
    """Map one demonstration with a placement of its own."""
    arm = arm_paths(robot, [demonstration])
    own = correct_placement(arm, settings.search, placement, back_height)
    middle = np.eye(4)
    middle[:3, 3] = arm.paths[0][1][:, :3, 3].mean(axis=0)
    shift = own.apply(middle)[:3, 3] - placement.apply(middle)[:3, 3]
    turn = own.yaw - placement.yaw
    correction = Correction(
        name=demonstration.name,
        reason=reasons[demonstration.name],
        shift_m=float(np.linalg.norm(shift)),
        turn_rad=float(abs(np.arctan2(np.sin(turn), np.cos(turn)))),
        scale=own.scale / placement.scale,
    )
    return replace(map_with_placement(demonstration, own, robot, settings), correction=correction)


def reason_of(mapped: Mapped, settings: MappingSettings) -> str:
    """Say why a mapped demonstration cannot be used; empty if it can."""
    return _reason(mapped.trajectory, mapped.report, settings)


def sort_out(
    mapped: list[Mapped],
    placement: Placement,
    robot: Robot,
    failures: list[Failure],
    settings: MappingSettings,
) -> Mapping:
    """Keep what the arm can run; list the rest with its reason."""
    kept: list[Mapped] = []
    worst = (-1.0, failures[0] if failures else None)
    aimed = any(np.isfinite(one.trajectory.target).all() for one in mapped)
    failed = list(failures)
    for one in mapped:
        trajectory, reason = one.trajectory, reason_of(one, settings)
        if aimed and not np.isfinite(trajectory.target).all():
            reason = "the flight of the thrown object was not seen, so there is no target"
        if reason:
            failed.append(Failure(trajectory.name, reason))
            error = float(trajectory.position_error.max())
            worst = max(worst, (error, failed[-1]), key=lambda pair: pair[0])
        else:
            kept.append(one)
    if not kept:
        raise MappingError(
            f"none of {len(failed)} demonstrations can be transferred to {robot.name} "
            f"(tool {robot.tool.name}); the worst: {worst[1]}"
        )
    return Mapping(
        trajectories=tuple(one.trajectory for one in kept),
        placement=placement.pose,
        failed=tuple(failed),
        terms=placement.terms,
        limit_violations=sum(one.report.violations for one in kept),
        self_collisions=sum(one.report.self_collisions for one in kept),
        scale=placement.scale,
        corrected=tuple(one.correction for one in kept if one.correction is not None),
    )


def back_height(demonstrations: tuple[HandTrajectory, ...]) -> float | None:
    """Return how high the back is above the floor, known where a target on the floor is."""
    heights = [-one.target[2] for one in demonstrations if np.isfinite(one.target).all()]
    return float(np.mean(heights)) if heights else None


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
    poses: FloatArray = hand2back @ _tcp2hand(demonstration, robot)
    return poses


def _tcp2hand(demonstration: HandTrajectory, robot: Robot) -> FloatArray:
    """Return where the tool centre point is in the hand: as was demonstrated, or as the tool is."""
    tcp2hand = np.array(robot.tool.tcp2hand)
    position, turn = demonstration.grasp[:3], demonstration.grasp[3:]
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


def _check(one: HandTrajectory) -> None:
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


def _map_one(
    demonstration: HandTrajectory, poses: FloatArray, robot: Robot, settings: MappingSettings
) -> tuple[JointTrajectory, LimitReport]:
    """Solve, smooth and slow down one demonstration, and check it at 1 kHz."""
    path = solve_path(
        robot,
        poses,
        weights=settings.ik,
        free_spin=settings.free_spin,
        step_s=float(demonstration.time[1] - demonstration.time[0]),
        seed=settings.seed,
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
    _, *dense = resample(scaled.time, scaled.positions, scaled.velocities, scaled.accelerations)
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


def _reason(trajectory: JointTrajectory, report: LimitReport, settings: MappingSettings) -> str:
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
        return (
            "the weight of arm and tool alone asks for more torque than a joint has "
            f"({report.torque_ratio:.2f} of its limit)"
        )
    if report.violations:
        return f"limits of speed or acceleration are exceeded in {report.violations} samples"
    return ""
