"""A link's surface, shared out among its capsules, and how these can be split."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

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
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
Capsule = tuple[FloatArray, float]
Surface = tuple[str, int, FloatArray, IntArray]

# How far apart what is clear is does not matter.
_CLEAR_M = 1e-6
_CUTS = (0.3, 0.5, 0.7)
# Longer edges are halved: a triangle lies wholly in one capsule.
_EDGE_SHARE = 1 / 8
# Of a surface; what meets another link in some poses has others nearby meet it in other poses.
_REGION_SHARE = 0.05


@dataclass(frozen=True)
class Split:
    """A capsule in two: its number, triangles (F,) of the second part, and both capsules.

    `placed` has their ends in the world in all poses, shape (2, B, 2, 3), metres.
    """

    piece: int
    second: BoolArray
    both: list[Capsule]
    placed: FloatArray

    @property
    def radii(self) -> FloatArray:
        """Radii of both capsules, metres."""
        return np.array([radius for _, radius in self.both])


@dataclass
class LinkPieces:
    """A link's surface, shared out among its capsules.

    Attributes
    ----------
    joint : int
        That moves the link; -1: none.
    vertices, triangles : array, shape (V, 3), (F, 3)
        In the joint's frame, metres; edges short, and not too many.
    areas : array, shape (F,)
        Of the triangles, shares of their sum.
    owner : int array, shape (F,)
        Capsule that each triangle lies in.
    capsules : list of (ends, radius)
    placed : array, shape (C, B, 2, 3)
        Ends in the world in all poses, metres.
    whole : (vertices, triangles)
        All of the surface, as `vertices` and `triangles`, which are it if it is not too fine.
    changed : bool
        Whether the capsules are to be fitted anew to what they hold.
    """

    joint: int
    vertices: FloatArray
    triangles: IntArray
    areas: FloatArray
    owner: IntArray
    capsules: list[Capsule]
    placed: FloatArray
    whole: tuple[FloatArray, IntArray]
    changed: bool = False

    @property
    def radii(self) -> FloatArray:
        """Radii of the capsules, metres."""
        return np.array([radius for _, radius in self.capsules])

    @property
    def shares(self) -> FloatArray:
        """Shares of the surface that the capsules hold, shape (C,)."""
        return np.asarray(np.bincount(self.owner, self.areas, len(self.capsules)), np.float64)

    def splits(
        self, piece: int, robot: Robot, poses: FloatArray, apart: BoolArray | None = None
    ) -> list[Split]:
        """Return ways to split a capsule: across its axes, and what is apart (F,) from the rest."""
        mine = np.flatnonzero(self.owner == piece)
        centres = self.vertices[self.triangles[mine]].mean(axis=1)
        centres = centres - centres.mean(axis=0)
        sides = [] if apart is None else [apart[mine]]
        for axis in np.linalg.svd(centres, full_matrices=False)[2]:
            along = centres @ axis
            sides += [along > along.min() + cut * np.ptp(along) for cut in _CUTS]
        found = []
        for beyond in sides:
            if beyond.all() or not beyond.any():
                continue
            second = np.zeros(len(self.owner), dtype=np.bool_)
            second[mine[beyond]] = True
            parts = [self.triangles[mine[~beyond]], self.triangles[mine[beyond]]]
            both = [fit_capsule(self.vertices[np.unique(part)]) for part in parts]
            found.append(Split(piece, second, both, _place(robot, self.joint, both, poses)))
        return found

    def apply(self, split: Split) -> None:
        """Split a capsule."""
        self.changed = True
        self.owner[split.second] = len(self.capsules)
        self.capsules[split.piece] = split.both[0]
        self.capsules.append(split.both[1])
        self.placed[split.piece] = split.placed[0]
        self.placed = np.concatenate([self.placed, split.placed[1:]])

    def enclose(self) -> tuple[list[Capsule], IntArray]:
        """Return capsules around what is shared out of the whole surface, and its owners (F,)."""
        vertices, triangles = self.whole
        if not self.changed:
            return self.capsules, np.argmin(sticking_out(self.capsules, *self.whole), axis=0)
        # Capsules that hold nothing are dropped.
        used, owner = np.unique(self.owner[self.coarse_of_whole], return_inverse=True)
        parts = [np.unique(triangles[owner == at]) for at in range(len(used))]
        return [fit_capsule(vertices[part]) for part in parts], owner

    @cached_property
    def regions(self) -> IntArray:
        """Number of the cell of a grid that each triangle lies in, shape (F,)."""
        centres = self.vertices[self.triangles].mean(axis=1)
        side = max(_REGION_SHARE * float(np.ptp(centres, axis=0).max()), 1e-9)
        cells = np.floor((centres - centres.min(axis=0)) / side).astype(np.int64)
        return np.asarray(np.unique(cells, axis=0, return_inverse=True)[1]).ravel()

    def held(self, split: Split | None = None) -> BoolArray:
        """Tell what regions capsules have triangles in, or the two of a split, shape (C, R)."""
        owner, count = self.owner, len(self.capsules)
        if split is not None:
            owner, count = np.where(split.second, 1, np.where(owner == split.piece, 0, 2)), 2
        found = np.zeros((max(count, 3), int(self.regions.max()) + 1), dtype=np.bool_)
        found[owner, self.regions] = True
        return found[:count]

    @cached_property
    def coarse_of_whole(self) -> IntArray:
        """The nearest of the triangles to each of the whole surface, shape (F,)."""
        from scipy.spatial import KDTree

        if self.whole[1] is self.triangles:
            return np.arange(len(self.triangles))
        vertices, triangles = self.whole
        centres = self.vertices[self.triangles].mean(axis=1)
        return np.asarray(KDTree(centres).query(vertices[triangles].mean(axis=1))[1])


def share_out(
    robot: Robot, surfaces: Sequence[Surface], poses: FloatArray
) -> dict[str, LinkPieces]:
    """Give the triangles of every link to the capsules that they lie in.

    Parameters
    ----------
    robot : Robot
        With its capsules.
    surfaces : sequence of (link, joint, vertices, triangles)
        As from `besman.robot.link_shapes.link_surfaces`.
    poses : array, shape (B, n)
        In which the capsules are placed, rad.
    """
    chain, found = robot.chain, {}
    names = np.array(chain.capsule_links)
    for name in sorted({link for link, *_ in surfaces} & set(chain.capsule_links)):
        mine = np.flatnonzero(names == name)
        fine = whole_surface(name, surfaces)
        if not len(fine[1]):
            continue
        vertices, triangles = coarser_mesh(*fine)
        capsules = contain(
            [(chain.capsule_ends[at], float(chain.capsule_radii[at])) for at in mine],
            vertices, triangles,
        )  # fmt: skip
        joint = int(chain.capsule_joints[mine[0]])
        found[name] = LinkPieces(
            joint, vertices, triangles, _areas(vertices[triangles]),
            np.argmin(sticking_out(capsules, vertices, triangles), axis=0), capsules,
            _place(robot, joint, capsules, poses), fine,
        )  # fmt: skip
    return found


def sticking_out(
    capsules: Sequence[Capsule], vertices: FloatArray, triangles: IntArray
) -> FloatArray:
    """Return how far triangles (F, 3) stick out of capsules, below zero inside, shape (C, F)."""
    away = np.stack([distances_to_axis(vertices, ends) - radius for ends, radius in capsules])
    return np.asarray(away[:, triangles].max(axis=2))


def whole_surface(name: str, surfaces: Sequence[Surface]) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles of all surfaces of a link, long edges halved."""
    vertices, triangles, count = [], [], 0
    for link, _, points, faces in surfaces:
        if link == name:
            vertices.append(points)
            triangles.append(faces + count)
            count += len(points)
    return subdivide(np.vstack(vertices), np.vstack(triangles), _EDGE_SHARE)


def _areas(corners: FloatArray) -> FloatArray:
    """Return the areas of triangles (F, 3, 3), shares of their sum."""
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas: FloatArray = np.linalg.norm(sides, axis=1)
    return areas / max(float(areas.sum()), 1e-18)


def _place(robot: Robot, joint: int, capsules: list[Capsule], poses: FloatArray) -> FloatArray:
    """Return the ends of a link's capsules in the world in all poses, shape (C, B, 2, 3)."""
    ends = np.array([ends for ends, _ in capsules])
    joints = np.full(len(capsules), joint)
    placed = place_all(robot.chain.placements, robot.chain.axes, joints, ends, poses)
    return np.ascontiguousarray(np.swapaxes(placed, 0, 1))


def least_gap(
    placed: FloatArray, radii: FloatArray, other: LinkPieces, meet: BoolArray
) -> FloatArray:
    """Return the least distance of some capsules to another link in all poses, shape (B,).

    Parameters
    ----------
    placed : array, shape (C, B, 2, 3)
        Ends in the world, metres.
    radii : array, shape (C,)
    other : LinkPieces
    meet : bool array, shape (C, number of the other's capsules)
        Which capsules are held against each other.
    """
    least = np.full(placed.shape[1], _CLEAR_M)
    rows = [slice(None)] if meet.all() else [slice(row, row + 1) for row in range(len(meet))]
    for row in rows:
        columns = meet[row].all(axis=0)
        if columns.any():
            sides = (placed[row], other.placed[columns])
            first, second = (np.ascontiguousarray(np.swapaxes(side, 0, 1)) for side in sides)
            gaps = least_gaps(first, radii[row], second, other.radii[columns], _CLEAR_M)
            least = np.minimum(least, gaps)
    return least
