"""Links that touch in every pose, or never: pairs that a robot.yaml leaves out, by sampling."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.robot.collision import place_capsules
from besman.robot.kinematics import compiled, fill_frames
from besman.robot.model import Robot
from besman.robot.nearest_pair import segment_distance
from besman.robot.parts import capsule_part

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

POSES = 1500
"""Random poses that links are looked at in."""

# Capsules that overlap more rarely cost little of the room to move.
_OFTEN = 0.02
# Of pairs of links that overlap in more than this share of the poses, the surfaces that single
# capsules hold are held against each other too: of links that enclose each other those beside the
# joint overlap in every pose, and none of them alone.
_MUCH = 0.1
_ALWAYS = 0.995
# Poses in which meshes are held against each other; below the least number nothing is concluded.
_MOST_MESH_POSES = 1500
LEAST_MESH_POSES = 25
# Meshes that come no nearer than this in so many poses are taken for never touching. Two joints lie
# between near links: so many poses leave no gap that something could be missed in.
_NEAR_MARGIN_M, _FAR_MARGIN_M = 0.0005, 0.005
_NEAR_JOINTS = 2
_PARTS_MARGIN_M = 0.002
# What is left out of all of a capsule's pairs is held against the meshes in so many other poses.
_OTHER_POSES = 6000

MeshesTouch = Callable[[str, str, FloatArray, float], tuple[int, int] | None]
"""Tells of two links, in poses (B, n), how often meshes are within a margin, and how many poses it
looked at: no further ones once they were and were not. None where there are no meshes."""

PartsMeet = Callable[[int, int, FloatArray, float], bool]
"""Tells of two capsules whether the surfaces that they hold come within a margin in some poses."""


def random_poses(robot: Robot, count: int, seed: int = 0) -> FloatArray:
    """Return random configurations within the limits, shape (count, n), rad."""
    limits = robot.limits
    share = np.random.default_rng(seed).random((count, robot.n))
    return limits.position_min + share * (limits.position_max - limits.position_min)


def pair_overlaps(
    robot: Robot, poses: FloatArray, columns: Sequence[int] | None = None
) -> BoolArray:
    """Tell which pairs of capsules, or those of some numbers, overlap in which poses: (B, P)."""
    chain = robot.chain
    pairs = chain.capsule_pairs if columns is None else chain.capsule_pairs[columns]
    overlaps: BoolArray = _overlaps(
        chain.placements,
        chain.axes,
        chain.capsule_joints,
        chain.capsule_ends,
        chain.capsule_radii,
        pairs,
        poses,
    )
    return overlaps


@compiled
def _overlaps(
    placements: FloatArray,
    axes: FloatArray,
    joints: IntArray,
    ends: FloatArray,
    radii: FloatArray,
    pairs: IntArray,
    rows: FloatArray,
) -> BoolArray:
    """Hold all pairs against each other in every pose."""
    rotations, origins = np.empty((len(axes), 3, 3)), np.empty((len(axes), 3))
    placed = np.empty((len(joints), 2, 3))
    found = np.zeros((len(rows), len(pairs)), dtype=np.bool_)
    for row in range(len(rows)):
        fill_frames(placements, axes, rows[row], rotations, origins)
        place_capsules(joints, ends, rotations, origins, placed)
        for pair in range(len(pairs)):
            first, second = pairs[pair, 0], pairs[pair, 1]
            distance = segment_distance(
                placed[first, 0], placed[first, 1], placed[second, 0], placed[second, 1]
            )
            found[row, pair] = distance <= radii[first] + radii[second]
    return found


def find_ignored_pairs(
    robot: Robot, meshes_touch: MeshesTouch, parts_meet: PartsMeet | None = None
) -> tuple[list[tuple[str, str]], list[str]]:
    """Find the pairs of links, or of their capsules, whose touching says nothing.

    Links that touch in every pose are built so. Capsules that overlap in many poses, while in those
    of them in which no other capsules of the two links do the meshes never touch, only look as if
    something touched; so do those that hold surfaces which never touch.

    Parameters
    ----------
    robot : Robot
    meshes_touch : callable
        A `MeshesTouch`.
    parts_meet : callable, optional
        A `PartsMeet`.

    Returns
    -------
    pairs : list of pairs of str
        Links, or ``LINK#NUMBER`` of a link's capsule, sorted.
    notes : list of str
        One line for each pair of links: why.
    """
    poses = random_poses(robot, POSES)
    overlaps = pair_overlaps(robot, poses)
    chain = robot.chain
    by_pair: dict[tuple[str, str], list[int]] = {}
    for index, (first, second) in enumerate(chain.capsule_pairs):
        ends = sorted((chain.capsule_links[first], chain.capsule_links[second]))
        by_pair.setdefault((ends[0], ends[1]), []).append(index)
    pairs: list[tuple[str, str]] = []
    notes = []
    for names, columns in sorted(by_pair.items()):
        share = float(overlaps[:, columns].any(axis=1).mean())
        if "pedestal" in names and share >= _ALWAYS:
            # An arm whose shoulder lies on its base: what it stands on is below that.
            pairs.append(names)
            notes.append(f"ignored pair {names[0]}, {names[1]}: they overlap in every pose")
        if share < _OFTEN or {"pedestal", "tool"} & set(names):
            continue
        joints = chain.capsule_joints[chain.capsule_pairs[columns[0]]]
        near = _Pair(names, touching_margin(*joints))
        why = near.why_always(poses, share, meshes_touch)
        if why:
            pairs.append(names)
            notes.append(f"ignored pair {names[0]}, {names[1]}: {why}")
            continue
        ignored = near.columns_that_say_nothing(poses, overlaps[:, columns], meshes_touch)
        if parts_meet is not None and share > _MUCH:
            rest = [column for index, column in enumerate(columns) if index not in ignored]
            apart = _never_meeting(robot, rest, overlaps, parts_meet)
            ignored += [columns.index(column) for column in apart]
        if share > _MUCH and len(ignored) < len(columns):
            others = random_poses(robot, _OTHER_POSES, seed=2)
            looked = np.vstack([poses, others])
            ignored = capsules_that_say_nothing(
                robot.chain.capsule_pairs[columns],
                np.vstack([overlaps[:, columns], pair_overlaps(robot, others, columns)]),
                partial(near.never_touch, looked, meshes_touch),
                ignored,
            )
        if ignored:
            parts = [chain.capsule_pairs[columns[column]] for column in ignored]
            whole = len(ignored) == len(columns)
            pairs += [names] if whole else [_part_names(robot, part) for part in parts]
            notes.append(
                f"ignored {'pair' if whole else 'parts of the pair'} {names[0]}, {names[1]}: "
                f"capsules overlap in {share:.0%} of {POSES} poses, meshes not where only these do"
            )
    return pairs, notes


def _never_meeting(
    robot: Robot, columns: list[int], overlaps: BoolArray, parts_meet: PartsMeet
) -> list[int]:
    """Return the pairs of capsules that overlap often and hold surfaces that never meet.

    They were split by the poses that gave the overlaps (B, P): other poses must agree.
    """
    often = [column for column in columns if overlaps[:, column].mean() >= _OFTEN]
    if not often:
        return []
    poses = np.vstack([random_poses(robot, POSES), random_poses(robot, POSES, seed=2)])
    found = pair_overlaps(robot, poses)
    apart = []
    for column in often:
        first, second = (int(one) for one in robot.chain.capsule_pairs[column])
        if not parts_meet(first, second, poses[found[:, column]], _PARTS_MARGIN_M):
            apart.append(column)
    return apart


def capsules_that_say_nothing(
    parts: IntArray,
    overlaps: BoolArray,
    never_touch: Callable[[BoolArray], bool],
    found: Sequence[int] = (),
) -> list[int]:
    """Find capsules of two links without whose pairs nothing is missed.

    Where a link turns close above another the capsules beside the joint overlap often, each with
    several: none of these pairs alone. Greedy, those that overlap most often first.

    Parameters
    ----------
    parts : int array, shape (P, 2)
        The links' pairs of capsules.
    overlaps : bool array, shape (B, P)
        Which of them overlap in which poses.
    never_touch : callable
        Tells of some of the poses (B,) whether the links touch in none of them.
    found : sequence of int
        Pairs that are left out already.

    Returns
    -------
    list of int
        All pairs that are left out: in poses in which no other pair overlaps the links do not
        touch.
    """
    left = list(found)
    rows = [np.flatnonzero((parts == one).any(axis=1)) for one in np.unique(parts)]
    for row in sorted(rows, key=lambda row: -int(overlaps[:, row].any(axis=1).sum())):
        new = np.setdiff1d(row, left)
        rest = np.setdiff1d(np.arange(len(parts)), [*left, *row])
        alone: BoolArray = np.any(overlaps[:, new], axis=1) & ~np.any(overlaps[:, rest], axis=1)
        if alone.mean() >= _OFTEN and never_touch(alone):
            left += new.tolist()
    return left


def touching_margin(joint: int, other: int) -> float:
    """Return how near meshes of two links may come that never touch, metres."""
    return _NEAR_MARGIN_M if abs(joint - other) <= _NEAR_JOINTS else _FAR_MARGIN_M


def _part_names(robot: Robot, part: IntArray) -> tuple[str, str]:
    """Return how a robot.yaml names two capsules, sorted."""
    names = sorted(capsule_part(robot.chain.capsule_links, index) for index in part)
    return names[0], names[1]


@dataclass(frozen=True)
class _Pair:
    """Two links, and how near their meshes may come and are still taken for never touching."""

    names: tuple[str, str]
    margin_m: float

    def why_always(self, poses: FloatArray, share: float, meshes_touch: MeshesTouch) -> str:
        """Say why touching in every pose says nothing; "" if they do not touch in every pose."""
        if share < _ALWAYS:
            return ""
        met = meshes_touch(*self.names, poses[:_MOST_MESH_POSES], 0.0)
        if met is None:
            return f"their capsules overlap in every one of {POSES} poses"
        touched, looked = met
        return f"their meshes touch in every one of {looked} poses" if touched == looked else ""

    def never_touch(self, poses: FloatArray, meshes_touch: MeshesTouch, some: BoolArray) -> bool:
        """Tell whether meshes stay apart in some (B,) of the poses."""
        met = meshes_touch(*self.names, poses[some], max(self.margin_m, _PARTS_MARGIN_M))
        return met is not None and met[0] == 0

    def columns_that_say_nothing(
        self, poses: FloatArray, overlaps: BoolArray, meshes_touch: MeshesTouch
    ) -> list[int]:
        """Return the pairs of capsules, among those of the links, without which nothing is missed.

        All, if meshes are apart in every pose in which any of them overlap. Else greedy, those that
        overlap most often first: meshes must be apart in all poses in which only pairs that are
        left out overlap.
        """
        some = poses[overlaps.any(axis=1)][:_MOST_MESH_POSES]
        if len(some) >= LEAST_MESH_POSES:
            met = meshes_touch(*self.names, some, self.margin_m)
            if met is not None and met[0] == 0:
                return list(range(overlaps.shape[1]))
        found: list[int] = []
        for column in np.argsort(-overlaps.sum(axis=0), kind="stable"):
            if overlaps[:, column].mean() < _OFTEN:
                break
            rest = [one for one in range(overlaps.shape[1]) if one not in (*found, column)]
            alone = overlaps[:, column] & ~overlaps[:, rest].any(axis=1)
            some = poses[alone][:_MOST_MESH_POSES]
            if len(some) < LEAST_MESH_POSES:
                continue
            met = meshes_touch(*self.names, some, self.margin_m)
            if met is not None and met[0] == 0:
                found.append(int(column))
        return found


def always_overlapping(robot: Robot, count: int = 200) -> list[tuple[str, str]]:
    """Return the pairs of links whose capsules overlap in each of some random poses."""
    always = pair_overlaps(robot, random_poses(robot, count)).all(axis=0)
    links, pairs = robot.chain.capsule_links, robot.chain.capsule_pairs
    return sorted({(links[a], links[b]) for a, b in pairs[always]})


def mesh_contacts(model: Any, geometry: Any) -> MeshesTouch:
    """Return what holds the meshes of links against each other.

    Parameters
    ----------
    model : pinocchio.Model
        The arm.
    geometry : list of (link, joint, pose, shape)
        Collision shapes in the frames of the joints that move them (-1: the world's).
    """
    import coal
    import pinocchio

    by_link: dict[str, list[tuple[int, Any, Any]]] = {}
    for link, joint, pose, shape in geometry:
        by_link.setdefault(link, []).append((joint, pose, shape))
    data = model.createData()

    def touch(first: str, second: str, poses: FloatArray, margin_m: float) -> Any:
        if first not in by_link or second not in by_link:
            return None
        request = coal.CollisionRequest()
        request.security_margin = margin_m
        touched = 0
        for row, pose in enumerate(poses):
            pinocchio.forwardKinematics(model, data, pose)
            ends = [
                [
                    (shape, data.oMi[joint + 1] * place if joint >= 0 else place)
                    for joint, place, shape in by_link[link]
                ]
                for link in (first, second)
            ]
            pairs = [(one, other) for one in ends[0] for other in ends[1]]
            touched += any(_meet(coal, request, *one, *other) for one, other in pairs)
            if 0 < touched <= row:
                return touched, row + 1
        return touched, len(poses)

    return touch


def _meet(coal: Any, request: Any, one: Any, place: Any, other: Any, other_place: Any) -> bool:
    """Tell whether two placed shapes touch."""
    result = coal.CollisionResult()
    poses = [coal.Transform3s(at.rotation, at.translation) for at in (place, other_place)]
    return bool(coal.collide(one, poses[0], other, poses[1], request, result))


def link_pairs(robot: Robot) -> list[tuple[str, str]]:
    """Return all pairs of links that are held against each other."""
    links = robot.chain.capsule_links
    named = {tuple(sorted((links[a], links[b]))) for a, b in robot.chain.capsule_pairs}
    return sorted((one, other) for one, other in named)
