"""The least stretch of time for which a small change of the path keeps the arm's limits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.kinematics import forward_kinematics, jacobian
from besman.robot.model import Robot
from besman.stages.map.joint_spline import DEGREE, JointSpline
from besman.stages.map.limit_program import ChangeMetric, TorqueRows, solve_change
from besman.stages.map.needed_stretch import ChangeTolerance, needed_stretch

FloatArray = npt.NDArray[np.float64]

# Changes are measured in shares of the tolerance, but in no smaller units than these (m, rad).
_LEAST_UNITS = 1e-3, np.radians(1.0)
_NOTHING = 1e-9
# One radian of a joint weighs as much as the greatest change of the tool: what the tool's path
# leaves open is used, but not for its own sake.
_JOINT_WEIGHT = 1.0
_GREATEST_ROUNDS = 3
_GREATEST_TRIALS = 8
# A stretch that is known this well is known well enough.
_RESOLUTION = 0.02
# A trial aims at this size of the change, and goes so far from its lower end at least.
_AIM, _LEAST_SHARE = 0.85, 0.2
# A round that leaves this share of the change has come to its end.
_PROGRESS = 0.97


class PathChange:
    """Changes of one path: their metric, linearised, and their size.

    Parameters
    ----------
    robot : Robot
    positions : array, shape (T, n)
        The path to stay near at the spline's samples, rad.
    tolerance : ChangeTolerance
        The units of the change: position and orientation count by their share of it.
    """

    def __init__(self, robot: Robot, positions: FloatArray, tolerance: ChangeTolerance) -> None:
        self._robot, self._tolerance = robot, tolerance
        self._positions = positions
        self._units = np.maximum((tolerance.position, tolerance.orientation), _LEAST_UNITS)
        self._poses = forward_kinematics(robot.chain, positions)

    def errors(self, positions: FloatArray) -> FloatArray:
        """Return the way (m) and the rotation vector (rad) from the path to `positions`.

        Along the world's axes, shape (T, 2, 3).
        """
        poses = forward_kinematics(self._robot.chain, positions)
        if self._tolerance.free_spin:
            turn = _turn_of_axes(self._poses[:, :3, 2], poses[:, :3, 2])
        else:
            turn = _turn(self._poses[:, :3, :3], poses[:, :3, :3])
        return np.stack([poses[:, :3, 3] - self._poses[:, :3, 3], turn], axis=1)

    def size(self, positions: FloatArray) -> float:
        """Return the greatest share of the tolerance; at most 1 is allowed."""
        greatest = np.linalg.norm(self.errors(positions), axis=2).max(axis=0)
        allowed = self._tolerance.position, self._tolerance.orientation
        return float(np.max(greatest / np.maximum(allowed, _NOTHING)))

    def metric(self, spline: JointSpline) -> ChangeMetric:
        """Linearise the mean square of the change at a spline (Gauss-Newton)."""
        basis, (count, n) = spline.basis, spline.points.shape
        positions = basis @ spline.points
        slopes = jacobian(self._robot.chain, positions)
        if self._tolerance.free_spin:
            axes = forward_kinematics(self._robot.chain, positions)[:, :3, 2]
            spin = np.einsum("ti,tin->tn", axes, slopes[:, 3:])
            slopes[:, 3:] -= axes[:, :, None] * spin[:, None]
        slopes /= np.repeat(self._units, 3)[:, None]
        squares = np.swapaxes(slopes, 1, 2) @ slopes + _JOINT_WEIGHT**2 * np.eye(n)
        errors = self.errors(positions) / self._units[:, None]
        pulls = np.einsum("tin,ti->tn", slopes, errors.reshape(-1, 6))
        pulls += _JOINT_WEIGHT**2 * (positions - self._positions)
        bands = np.zeros((DEGREE + 1, count, n, n))
        for shift in range(min(DEGREE + 1, count)):
            both = basis[:, : count - shift] * basis[:, shift:]
            product = both.T @ squares.reshape(len(squares), -1)
            bands[shift, : count - shift] = product.reshape(-1, n, n)
        return ChangeMetric(bands / len(basis), basis.T @ pulls / len(basis))


def _turn_of_axes(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the least rotation vectors (T, 3) that turn unit axes onto others, rad."""
    a, b = before.T, after.T
    # numpy's own cross product takes ten times as long for so few rows.
    normal = np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]], axis=1
    )
    sine = np.linalg.norm(normal, axis=1)
    angle = np.arctan2(sine, np.sum(before * after, axis=1))
    turn: FloatArray = normal * (angle / np.maximum(sine, 1e-12))[:, None]
    return turn


def _turn(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the rotation vectors (T, 3) along the world's axes from one frame to another, rad."""
    relative = after @ np.swapaxes(before, 1, 2)
    skew = relative - np.swapaxes(relative, 1, 2)
    normal = 0.5 * np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    sine = np.linalg.norm(normal, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(relative, axis1=1, axis2=2) - 1.0))
    turn: FloatArray = normal * (angle / np.maximum(sine, 1e-12))[:, None]
    return turn


def torque_rows(robot: Robot, spline: JointSpline, stretch: float) -> TorqueRows:
    """Linearise the joint torques of a stretched movement at the spline's centres.

    Parameters
    ----------
    robot : Robot
    spline : JointSpline
    stretch : float
        Duration over the spline's own.

    Returns
    -------
    TorqueRows

    References
    ----------
    J. Carpentier, N. Mansard: Analytical derivatives of rigid body dynamics algorithms, 2018.
    doi:10.15607/RSS.2018.XIV.038
    """
    import pinocchio

    data = robot.model.createData()
    count, n = spline.points.shape
    scales = 1.0, 1.0 / stretch, 1.0 / stretch**2
    movement = [values * by for values, by in zip(spline.at(spline.centres), scales, strict=True)]
    parts, shares = np.empty((3, count, n, n)), np.empty((count, n))
    for row, state in enumerate(zip(*movement, strict=True)):
        pinocchio.computeRNEADerivatives(robot.model, data, *state)
        shares[row] = data.tau
        parts[:, row] = data.dtau_dq, data.dtau_dv, data.M
    parts[2] = np.triu(parts[2]) + np.swapaxes(np.triu(parts[2], 1), 1, 2)
    near = np.zeros((3, count, 2 * DEGREE + 1))
    for row in range(count):
        first, last = max(row - DEGREE, 0), min(row + DEGREE + 1, count)
        for basis, part, by in zip(spline.bases_at_centres, near, scales, strict=True):
            part[row, first - row + DEGREE : last - row + DEGREE] = by * basis[row, first:last]
    slopes = np.einsum("bkd,bkjm->kjdm", near, parts)
    torque = robot.limits.torque
    return TorqueRows(slopes / torque[:, None, None], shares / torque)


def smallest_change(
    robot: Robot,
    spline: JointSpline,
    change: PathChange,
    stretch: float,
    rounds: int,
    *,
    torques: bool = False,
) -> tuple[JointSpline, float]:
    """Change a path as little as possible so that it keeps the limits in a given time.

    Sequential convex programming: the change of the tool's path and, if asked for, the torques are
    linearised anew around every solution.

    Parameters
    ----------
    robot : Robot
    spline : JointSpline
        Where to start.
    change : PathChange
        Measure of the change.
    stretch : float
        Duration over the spline's own.
    rounds : int
        At most so many; fewer if the change is within its tolerance or gets no smaller.
    torques : bool
        Keep torque limits, too: between the times looked at they may be exceeded a little.

    Returns
    -------
    spline : JointSpline
        Its control points keep the limits of position, velocity and acceleration.
    size : float
        `PathChange.size`.

    Raises
    ------
    MappingError
        If the spline is too long for the program or the solver fails.
    """
    limits = robot.limits
    best, least = spline, np.inf
    for _ in range(rounds):
        rows = torque_rows(robot, spline, stretch) if torques else None
        step = solve_change(spline, change.metric(spline), limits, stretch, rows)
        points = np.clip(spline.points + step, limits.position_min, limits.position_max)
        spline = spline.moved(points)
        size, before = change.size(spline.basis @ points), least
        if size < least:
            best, least = spline, size
        if size <= 1.0 or size > _PROGRESS * before:
            break
    return best, least


def _between(low: float, high: float, size_low: float, size_high: float) -> float:
    """Return the stretch to try next: where a line through both sizes is a little below 1."""
    share = 0.5
    if np.isfinite(size_low) and size_low > 1.0 > size_high:
        share = float(np.clip((size_low - _AIM) / (size_low - size_high), _LEAST_SHARE, 0.8))
    return float(low * (high / low) ** share)


def shorten(
    robot: Robot,
    spline: JointSpline,
    positions: FloatArray,
    tolerance: ChangeTolerance,
    least_stretch: float,
) -> JointSpline:
    """Find the path near another one for which time must be stretched least.

    Regula falsi in the stretch, every trial from the best path so far, in no part of what is left
    smaller than a fifth.

    Parameters
    ----------
    robot : Robot
    spline : JointSpline
        The smoothed path.
    positions : array, shape (T, n)
        The path to stay near, at the spline's samples, rad.
    tolerance : ChangeTolerance
        Kept, unless the limits of position ask for more.
    least_stretch : float
        No less is looked for.

    Returns
    -------
    JointSpline
        Within the limits of position; `besman.stages.map.needed_stretch.needed_stretch` says which
        stretch it needs.

    Raises
    ------
    MappingError
        If the spline is too long for the program or the solver fails.
    """
    change, torques = PathChange(robot, positions, tolerance), False
    high = max(needed_stretch(robot, spline), least_stretch)
    if not spline.inside(robot.limits):
        spline, size = smallest_change(robot, spline, change, high, _GREATEST_ROUNDS)
        high = max(needed_stretch(robot, spline), least_stretch)
        if size > 1.0:
            return spline
    low = trial = least_stretch
    # Sizes of the change at both ends; none is needed at the upper one.
    size_low, size_high = np.inf, 0.0
    best = None
    for _ in range(_GREATEST_TRIALS):
        if high <= (1.0 + _RESOLUTION) * low:
            break
        found, size = smallest_change(
            robot, spline, change, trial, _GREATEST_ROUNDS, torques=torques
        )
        # How fast a change that is too large could be does not matter.
        needed = max(needed_stretch(robot, found), least_stretch) if size <= 1.0 else np.inf
        if np.isfinite(needed) and needed > (1.0 + _RESOLUTION) * trial and not torques:
            # Nothing but torques can be left: they rarely matter, and cost as much as the rest.
            torques = True
            continue
        if needed < high:
            spline, high, best = found, needed, (trial, size)
            size_high = size
        else:
            low, size_low = trial, size
        trial = _between(low, high, size_low, size_high)
    if best is None:
        return spline
    polished, size = smallest_change(robot, spline, change, best[0], 1, torques=torques)
    return polished if size < best[1] and needed_stretch(robot, polished) <= high else spline
