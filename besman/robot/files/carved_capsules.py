"""Capsules split where they cost an arm room: where they overlap though the meshes are apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.robot.files.link_pieces import (
    Capsule,
    LinkPieces,
    Split,
    Surface,
    least_gap,
    share_out,
)
from besman.robot.files.surface_contacts import meeting_regions
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
Progress = Callable[[float], None]

# Meshes so far apart should be called clear.
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
# Capsules of a link that are tried, those first that cost most.
_TRIED_OF_MUCH = 3
# An overlap costs this much, and its depth up to the greatest.
_TOUCH_M, _DEEPEST_M = 0.005, 0.2
# Surfaces that come this near in poses that are looked at may meet in others.
_BESIDE_M = 0.0015
# Those poses: links that meet rarely are looked at in many, those that meet often in fewer.
_MET_POSES, _MET_ENOUGH = 6000, 200
# Poses in which what is lost is measured: the meshes' distance is what costs time.
_LOOKED_POSES = 600


@dataclass(frozen=True)
class Carved:
    """Capsules of a link in the frame of its joint, metres, and what they hold.

    Attributes
    ----------
    capsules : list of (ends, radius)
    owner : int array, shape (F,)
        Capsule in which each triangle of the link's `whole_surface` wholly lies.
    changed : bool
        Whether they are others than before.
    """

    capsules: list[Capsule]
    owner: IntArray
    changed: bool


@dataclass
class _Pair:
    """Two links: least gap (B,) in all poses, and how much an overlap counts in each (B,).

    An overlap counts in full until it was looked at. Of links that cost much, `met` (R, S) is 1
    where regions of theirs come near each other in any pose: capsules that hold no such regions
    need not be held against each other.
    """

    names: tuple[str, str]
    gaps: FloatArray
    counts: FloatArray
    looked: BoolArray
    met: npt.NDArray[np.float32] | None = None

    @property
    def lost(self) -> float:
        """Share of the poses in which capsules overlap, and meshes do not come near."""
        return float(np.mean(np.where(self.gaps <= 0, self.counts, 0.0)))

    def other(self, name: str) -> str:
        """Return the link that is not this one."""
        return self.names[self.names[0] == name]

    def meet(
        self, links: dict[str, LinkPieces], name: str, split: Split | None = None
    ) -> BoolArray:
        """Tell which capsules of a link can meet which of the other, shape (C, D).

        With a split: which of its two capsules.
        """
        own, other = links[name].held(split), links[self.other(name)].held()
        if self.met is None:
            return np.ones((len(own), len(other)), dtype=np.bool_)
        met = self.met if name == self.names[0] else self.met.T
        return np.asarray(own.astype(np.float32) @ met @ other.T.astype(np.float32) > 0)

    def meet_surfaces(self, links: dict[str, LinkPieces], robot: Robot) -> None:
        """Find out which triangles come near the other link."""
        both = [links[name] for name in self.names]
        first, second = ((own.joint, *own.whole) for own in both)
        margin = touching_margin(first[0], second[0]) + _BESIDE_M
        labels = [own.regions[own.coarse_of_whole] for own in both]
        poses = random_poses(robot, _MET_POSES, seed=1)
        met = meeting_regions(robot.model, (first, second), labels, poses, margin, _MET_ENOUGH)
        # Multiplied often: no conversion then.
        self.met = met.astype(np.float32)
        for own in both:
            own.changed = True
        self.measure(links)

    def never_met(self, links: dict[str, LinkPieces], name: str) -> BoolArray | None:
        """Tell which triangles (F,) of a link lie where none meets the other; None: unknown."""
        if self.met is None:
            return None
        met = np.asarray(self.met.any(axis=1 - self.names.index(name)))
        return ~met[links[name].regions]

    def gaps_after(self, links: dict[str, LinkPieces], name: str, split: Split) -> FloatArray:
        """Return the least gap (B,) that a split of a link's capsule would leave."""
        own, other = links[name], links[self.other(name)]
        rest = np.arange(len(own.capsules)) != split.piece
        meet = self.meet(links, name)[rest]
        return np.minimum(
            least_gap(own.placed[rest], own.radii[rest], other, meet),
            least_gap(split.placed, split.radii, other, self.meet(links, name, split)),
        )

    def measure(self, links: dict[str, LinkPieces]) -> None:
        """Compute the least gap in all poses."""
        first, second = (links[name] for name in self.names)
        self.gaps = least_gap(first.placed, first.radii, second, self.meet(links, self.names[0]))


def carve_capsules(
    robot: Robot,
    surfaces: Sequence[Surface],
    meshes_touch: MeshesTouch,
    progress: Progress = lambda share: None,
) -> dict[str, Carved]:
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
    dict of Carved
        By link.
    """
    # Those by which pairs are left out later.
    poses = random_poses(robot, POSES)
    links = share_out(robot, surfaces, poses)
    pairs = []
    for names in link_pairs(robot):
        if set(names) <= set(links):
            pair = _Pair(names, *(np.empty(0),) * 2, np.empty(0, np.bool_))
            pair.measure(links)
            margin = touching_margin(*(links[name].joint for name in names))
            if not _says_nothing(names, poses[pair.gaps <= 0], meshes_touch, margin):
                pair.gaps = pair.gaps[:_LOOKED_POSES]
                pair.counts = np.ones(len(pair.gaps))
                pair.looked = np.zeros(len(pair.gaps), np.bool_)
                pairs.append(pair)
    poses = poses[:_LOOKED_POSES]
    for own in links.values():
        own.placed = np.ascontiguousarray(own.placed[:, : len(poses)])
    for pair in pairs:
        _look(pair, poses, meshes_touch)
    given_up: list[_Pair] = []
    for count in range(_MOST_SPLITS):
        progress(count / _MOST_SPLITS)
        worst = max(pairs, key=lambda pair: pair.lost, default=None)
        if worst is None or worst.lost < _FINE_PAIR or _lost_by_all(pairs, given_up) < _FINE:
            break
        if worst.lost > _MUCH and worst.met is None:
            worst.meet_surfaces(links, robot)
            continue
        found = _best_split(links, worst, [*pairs, *given_up], robot, poses)
        if found is None and worst.lost > _MUCH:
            found = _widest_split(links, worst, robot, poses)
        if found is None:
            pairs.remove(worst)
            given_up.append(worst)
            continue
        link, split = found
        links[link].apply(split)
        for pair in (*pairs, *given_up):
            if link in pair.names:
                pair.measure(links)
                _look(pair, poses, meshes_touch)
    return {name: Carved(*own.enclose(), own.changed) for name, own in links.items()}


def _lost_by_all(*pairs: list[_Pair]) -> float:
    """Return the share of the poses in which any pair overlaps though meshes are apart."""
    lost = [(pair.gaps <= 0) & (pair.counts > 0) for some in pairs for pair in some]
    return float(np.mean(np.any(lost, axis=0))) if lost else 0.0


def _look(pair: _Pair, poses: FloatArray, meshes_touch: MeshesTouch) -> None:
    """Hold meshes against each other where capsules overlap: what is near does not count."""
    for row in np.flatnonzero((pair.gaps <= 0) & ~pair.looked):
        pair.looked[row] = True
        # Whether meshes touch is known much sooner than whether they are near.
        for margin, share in ((0.0, 0.0), (_APART_M, _NEAR_SHARE)):
            met = meshes_touch(*pair.names, poses[row : row + 1], margin)
            if met is None or met[0]:
                pair.counts[row] = 0.0 if met is None else share
                break


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


def _best_split(
    links: dict[str, LinkPieces],
    pair: _Pair,
    pairs: Sequence[_Pair],
    robot: Robot,
    poses: FloatArray,
) -> tuple[str, Split] | None:
    """Return the link of a pair, and the split of a capsule of it that helps most; None: no one."""
    much = pair.lost > _MUCH
    most = (_WORTH_OF_MUCH if much else _WORTH) * _cost(pair.gaps, pair.counts)
    pieces, best = _MOST_PIECES_OF_MUCH if much else _MOST_PIECES, None
    for name in pair.names:
        own = links[name]
        if len(own.capsules) >= pieces:
            continue
        touched = [one for one in pairs if name in one.names]
        others = [links[one.other(name)] for one in touched]
        meet = [one.meet(links, name) for one in touched]
        each = [
            [
                least_gap(own.placed[at : at + 1], own.radii[at : at + 1], other, can[at : at + 1])
                for other, can in zip(others, meet, strict=True)
            ]
            for at in range(len(own.capsules))
        ]
        this = touched.index(pair)
        costs = [_cost(gaps[this], pair.counts) for gaps in each]
        before = sum(_cost(one.gaps, one.counts) for one in touched)
        apart = pair.never_met(links, name)
        for piece in np.argsort(costs)[: -(_TRIED_OF_MUCH if much else 1) - 1 : -1]:
            rest = np.full((len(others), len(poses)), np.inf)
            for kept in (*each[:piece], *each[piece + 1 :]):
                rest = np.minimum(rest, kept)
            for split in own.splits(int(piece), robot, poses, apart):
                after = 0.0
                for left, other, one in zip(rest, others, touched, strict=True):
                    gaps = least_gap(split.placed, split.radii, other, one.meet(links, name, split))
                    after += _cost(np.minimum(left, gaps), one.counts)
                if before - after > most:
                    most, best = before - after, (name, split)
    return best


def _widest_split(
    links: dict[str, LinkPieces], pair: _Pair, robot: Robot, poses: FloatArray
) -> tuple[str, Split] | None:
    """Return the split after which least surface overlaps; as `_best_split`.

    Where links overlap deeply, or several capsules at once, no single split changes how deep they
    do: it is the first of several. Surface counts by its share of one link times that of the other.
    """
    best, most, before = None, _WORTH_OF_MUCH, _cost(pair.gaps, pair.counts)
    for name in pair.names:
        own, other = links[name], links[pair.other(name)]
        if len(own.capsules) >= _MOST_PIECES_OF_MUCH:
            continue
        blocked = own.shares * _blocked(
            own.placed, own.radii, other, pair.meet(links, name), pair.counts
        )
        piece, apart = int(np.argmax(blocked)), pair.never_met(links, name)
        for split in own.splits(piece, robot, poses, apart):
            part = float(own.areas[split.second].sum())
            meet = pair.meet(links, name, split)
            left = np.array([own.shares[piece] - part, part]) @ _blocked(
                split.placed, split.radii, other, meet, pair.counts
            )
            saved = (blocked[piece] - left) / max(float(blocked.sum()), 1e-18)
            if saved > most and _cost(pair.gaps_after(links, name, split), pair.counts) <= before:
                most, best = saved, (name, split)
    return best


def _blocked(
    placed: FloatArray,
    radii: FloatArray,
    other: LinkPieces,
    meet: BoolArray,
    counts: FloatArray,
) -> FloatArray:
    """Return what share of a link's surface capsules (C, B, 2, 3) overlap, mean of poses, (C,)."""
    found = np.zeros(len(placed))
    for one, two in np.argwhere(meet):
        alone = np.zeros((1, meet.shape[1]), dtype=np.bool_)
        alone[0, two] = True
        gaps = least_gap(placed[one : one + 1], radii[one : one + 1], other, alone)
        found[one] += other.shares[two] * float(np.mean(np.where(gaps <= 0, counts, 0.0)))
    return found
