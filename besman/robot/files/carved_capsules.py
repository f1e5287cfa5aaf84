"""Capsules split where they cost an arm room: where they overlap though the meshes are apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.robot.capsules import (
    coarser_mesh,
    contain,
    distances_to_axis,
    fit_capsule,
    subdivide,
)
from besman.robot.collision import least_gaps, place_all
from besman.robot.files.touching_links import (
    LEAST_MESH_POSES,
    POSES,
    MeshesTouch,
    link_pairs,
    random_poses,
    touching_margin,
)
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
Capsule = tuple[FloatArray, float]
Surface = tuple[str, int, FloatArray, IntArray]
Progress = Callable[[float], None]

# Meshes so far apart should be called clear.
_CLEAR_M = 1e-6
_APART_M = 0.01
# Where they are nearer, but do not touch, an overlap counts less.
_NEAR_SHARE = 0.3
# Of room that is lost in less than these shares of the poses, by all pairs or by one, nothing is
# made: every further capsule costs time in every check.
_FINE, _FINE_PAIR = 0.03, 0.004
_MOST_SPLITS = 24
_MOST_PIECES, _MOST_PIECES_OF_MUCH, _MUCH = 6, 12, 0.1
# A split must save this share of what the pair costs; of a pair that costs much less: where two
# links enclose each other one split shows little before the next ones do.
_WORTH, _WORTH_OF_MUCH = 0.08, 0.02
_CUTS = (0.3, 0.5, 0.7)
# An overlap costs this much, and its depth up to the greatest.
_TOUCH_M, _DEEPEST_M = 0.005, 0.05
# Poses in which what is lost is measured: the meshes' distance is what costs time.
_LOOKED_POSES = 600
# Longer edges are halved: a triangle lies wholly in one capsule.
_EDGE_SHARE = 1 / 8


@dataclass
class _Pieces:
    """A link's surface, shared out among its capsules.

    Attributes
    ----------
    joint : int
        That moves the link; -1: none.
    vertices, triangles : array, shape (V, 3), (F, 3)
        In the joint's frame, metres; edges short, and not too many.
    owner : int array, shape (F,)
        Capsule that each triangle lies in.
    capsules : list of (ends, radius)
    placed : array, shape (C, B, 2, 3)
        Ends in the world in all poses, metres.
    """

    joint: int
    vertices: FloatArray
    triangles: IntArray
    owner: IntArray
    capsules: list[Capsule]
    placed: FloatArray

    @property
    def radii(self) -> FloatArray:
        """Radii of the capsules, metres."""
        return np.array([radius for _, radius in self.capsules])

    def splits(self, piece: int) -> list[tuple[BoolArray, list[Capsule]]]:
        """Return ways to split a capsule: the triangles of the second part, and both capsules."""
        mine = np.flatnonzero(self.owner == piece)
        centres = self.vertices[self.triangles[mine]].mean(axis=1)
        centres = centres - centres.mean(axis=0)
        found = []
        for axis in np.linalg.svd(centres, full_matrices=False)[2]:
            along = centres @ axis
            for cut in _CUTS:
                beyond = along > along.min() + cut * np.ptp(along)
                if beyond.all() or not beyond.any():
                    continue
                second = np.zeros(len(self.owner), dtype=np.bool_)
                second[mine[beyond]] = True
                parts = [self.triangles[mine[~beyond]], self.triangles[mine[beyond]]]
                found.append((second, [fit_capsule(self.vertices[np.unique(p)]) for p in parts]))
        return found


@dataclass
class _Pair:
    """Two links: least gap (B,) in all poses, and how much an overlap counts in each (B,).

    An overlap counts in full until it was looked at.
    """

    names: tuple[str, str]
    gaps: FloatArray
    counts: FloatArray
    looked: BoolArray

    @property
    def lost(self) -> float:
        """Share of the poses in which capsules overlap, and meshes do not come near."""
        return float(np.mean(np.where(self.gaps <= 0, self.counts, 0.0)))


def carve_capsules(
    robot: Robot,
    surfaces: Sequence[Surface],
    meshes_touch: MeshesTouch,
    progress: Progress = lambda share: None,
) -> dict[str, list[Capsule]]:
    """Split capsules of an arm where they overlap in poses in which the meshes are 1 cm apart.

    Greedy: of the pair of links that loses most, the capsule that overlaps most is cut in two
    across the axis and at the place that leaves least. Every triangle stays wholly inside a
    capsule.

    Parameters
    ----------
    robot : Robot
        With its capsules.
    surfaces : sequence of (link, joint, vertices, triangles)
        As from `besman.robot.link_shapes.link_surfaces`.
    meshes_touch : callable
        A `besman.robot.files.touching_links.MeshesTouch`.
    progress : callable
        Is told the share done.

    Returns
    -------
    dict of list of (ends, radius)
        New capsules of the links that have others now, by name, in the frames of their joints,
        metres.
    """
    # Those by which pairs are left out later.
    poses = random_poses(robot, POSES)
    links = _share_out(robot, surfaces, poses)
    pairs = []
    for names in link_pairs(robot):
        if set(names) <= set(links):
            gaps = _gaps(links, *names)
            margin = touching_margin(*(links[name].joint for name in names))
            if not _says_nothing(names, poses[gaps <= 0], meshes_touch, margin):
                gaps = gaps[:_LOOKED_POSES]
                pairs.append(_Pair(names, gaps, np.ones(len(gaps)), np.zeros(len(gaps), np.bool_)))
    poses = poses[:_LOOKED_POSES]
    for own in links.values():
        own.placed = np.ascontiguousarray(own.placed[:, : len(poses)])
    for pair in pairs:
        _look(pair, poses, meshes_touch)
    changed: set[str] = set()
    given_up: list[_Pair] = []
    for count in range(_MOST_SPLITS):
        progress(count / _MOST_SPLITS)
        worst = max(pairs, key=lambda pair: pair.lost, default=None)
        if worst is None or worst.lost < _FINE_PAIR or _lost_by_all(pairs, given_up) < _FINE:
            break
        link = _split_best(links, worst, [*pairs, *given_up], robot, poses)
        if link is None:
            pairs.remove(worst)
            given_up.append(worst)
            continue
        changed.add(link)
        for names in link_pairs(robot):
            if link in names and set(names) <= set(links):
                both = (*pairs, *given_up)
                known = next((one for one in both if one.names == names), None)
                if known is not None:
                    known.gaps = _gaps(links, *names)
                    _look(known, poses, meshes_touch)
    whole = {name: _whole(name, surfaces) for name in changed}
    return {name: contain(links[name].capsules, *whole[name]) for name in sorted(changed)}


def _lost_by_all(*pairs: list[_Pair]) -> float:
    """Return the share of the poses in which any pair overlaps though meshes are apart."""
    lost = [(pair.gaps <= 0) & (pair.counts > 0) for some in pairs for pair in some]
    return float(np.mean(np.any(lost, axis=0))) if lost else 0.0


def _whole(name: str, surfaces: Sequence[Surface]) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles of all surfaces of a link."""
    vertices, triangles, count = [], [], 0
    for link, _, points, faces in surfaces:
        if link == name:
            vertices.append(points)
            triangles.append(faces + count)
            count += len(points)
    return subdivide(np.vstack(vertices), np.vstack(triangles), _EDGE_SHARE)


def _share_out(robot: Robot, surfaces: Sequence[Surface], poses: FloatArray) -> dict[str, _Pieces]:
    """Give the triangles of every link to the capsules that they lie in."""
    chain, found = robot.chain, {}
    names = np.array(chain.capsule_links)
    for name in sorted({link for link, *_ in surfaces} & set(chain.capsule_links)):
        mine = np.flatnonzero(names == name)
        fine = _whole(name, surfaces)
        if not len(fine[1]):
            continue
        vertices, triangles = coarser_mesh(*fine)
        capsules = contain(
            [(chain.capsule_ends[at], float(chain.capsule_radii[at])) for at in mine],
            vertices, triangles,
        )  # fmt: skip
        away = np.stack([distances_to_axis(vertices, ends) - radius for ends, radius in capsules])
        joint = int(chain.capsule_joints[mine[0]])
        found[name] = _Pieces(
            joint, vertices, triangles, np.argmin(away[:, triangles].max(axis=2), axis=0),
            capsules, _place(robot, joint, capsules, poses),
        )  # fmt: skip
    return found


def _place(robot: Robot, joint: int, capsules: list[Capsule], poses: FloatArray) -> FloatArray:
    """Return the ends of a link's capsules in the world in all poses, shape (C, B, 2, 3)."""
    ends = np.array([ends for ends, _ in capsules])
    joints = np.full(len(capsules), joint)
    placed = place_all(robot.chain.placements, robot.chain.axes, joints, ends, poses)
    return np.ascontiguousarray(np.swapaxes(placed, 0, 1))


def _gaps(links: dict[str, _Pieces], first: str, second: str) -> FloatArray:
    """Return the least distance of two links' capsules in all poses, `_least`'s, shape (B,)."""
    one, other = links[first], links[second]
    return _least(one.placed, one.radii, other)


def _least(placed: FloatArray, radii: FloatArray, other: _Pieces) -> FloatArray:
    """Return the least distance of some capsules to another link in all poses, shape (B,).

    How far apart what does not overlap is does not matter: that is `_CLEAR_M`.
    """
    sides = (np.ascontiguousarray(np.swapaxes(side, 0, 1)) for side in (placed, other.placed))
    first, second = sides
    gaps: FloatArray = least_gaps(first, radii, second, other.radii, _CLEAR_M)
    return gaps


def _look(pair: _Pair, poses: FloatArray, meshes_touch: MeshesTouch) -> None:
    """Hold meshes against each other where capsules overlap: what is near does not count."""
    for row in np.flatnonzero((pair.gaps <= 0) & ~pair.looked):
        pair.looked[row] = True
        for margin, share in ((_APART_M, _NEAR_SHARE), (0.0, 0.0)):
            met = meshes_touch(*pair.names, poses[row : row + 1], margin)
            if met is not None and not met[0]:
                break
            pair.counts[row] = 0.0 if met is None else share


def _says_nothing(
    names: tuple[str, str], some: FloatArray, meshes_touch: MeshesTouch, margin_m: float
) -> bool:
    """Tell whether meshes never touch where capsules overlap, and that often: left out later."""
    if len(some) < LEAST_MESH_POSES:
        return False
    met = meshes_touch(*names, some, margin_m)
    return met is not None and met[0] == 0


def _cost(gaps: FloatArray, counts: FloatArray) -> float:
    """Return what overlaps cost that count, metres."""
    deep = np.where(gaps <= 0, _TOUCH_M + np.minimum(-gaps, _DEEPEST_M), 0.0)
    return float(deep @ counts)


def _split_best(
    links: dict[str, _Pieces], pair: _Pair, pairs: Sequence[_Pair], robot: Robot, poses: FloatArray
) -> str | None:
    """Split one capsule of a pair where that helps most; return its link, None if nothing does."""
    much = pair.lost > _MUCH
    most = (_WORTH_OF_MUCH if much else _WORTH) * _cost(pair.gaps, pair.counts)
    pieces, best = _MOST_PIECES_OF_MUCH if much else _MOST_PIECES, None
    for name in pair.names:
        own = links[name]
        if len(own.capsules) >= pieces:
            continue
        touched = [one for one in pairs if name in one.names]
        others = [links[one.names[one.names[0] == name]] for one in touched]
        each = [
            [_least(own.placed[at : at + 1], own.radii[at : at + 1], other) for other in others]
            for at in range(len(own.capsules))
        ]
        this = touched.index(pair)
        piece = int(np.argmax([_cost(gaps[this], pair.counts) for gaps in each]))
        rest = np.full((len(others), len(poses)), np.inf)
        for gaps in (*each[:piece], *each[piece + 1 :]):
            rest = np.minimum(rest, gaps)
        before = sum(_cost(one.gaps, one.counts) for one in touched)
        for second, both in own.splits(piece):
            placed = _place(robot, own.joint, both, poses)
            radii = np.array([radius for _, radius in both])
            after = sum(
                _cost(np.minimum(left, _least(placed, radii, other)), one.counts)
                for left, other, one in zip(rest, others, touched, strict=True)
            )
            if before - after > most:
                most, best = before - after, (name, piece, second, both, placed)
    if best is None:
        return None
    name, piece, second, both, placed = best
    own = links[name]
    own.owner[second] = len(own.capsules)
    own.capsules[piece] = both[0]
    own.capsules.append(both[1])
    own.placed[piece] = placed[0]
    own.placed = np.concatenate([own.placed, placed[1:]])
    return name
