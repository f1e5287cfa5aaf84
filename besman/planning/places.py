"""Places at which objects were seen to stand: found, and named by the blocks that lead there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.planning.block_effects import BlockUse

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Place:
    """Where objects stood.

    Attributes
    ----------
    name : str
        What distinguishes the labels of the blocks that put something there.
    poses : array, shape (P, 7)
        Of the middles of what stood there, in the robot's world: position (m) and quaternion wxyz;
        the one in their midst first, and the farther away the later.
    """

    name: str
    poses: FloatArray

    @property
    def pose(self) -> FloatArray:
        """The pose in their midst, shape (7,)."""
        return np.asarray(self.poses[0])


def find_places(
    uses: Sequence[BlockUse], positions: FloatArray, size_m: Sequence[float]
) -> IntArray:
    """Tell which blocks lead to one place.

    Two lead to the same one if objects would stand in one another there, or if both bear one label,
    do the same, and their heights differ by less than half an object's; and all that is joined so.

    Parameters
    ----------
    uses : sequence of BlockUse, length U
    positions : array, shape (U, 3)
        Of the middle of each one's object, metres; NaN of what stands nowhere.
    size_m : sequence of three float
        Of an object; its height is the last.

    Returns
    -------
    array, shape (U,)
        Index of each one's place, in the order in which places are first seen; -1 for NaN.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    found = np.full(len(positions), -1, dtype=np.int64)
    known = np.flatnonzero(np.isfinite(positions).all(axis=1))
    does = np.array([f"{uses[row].frame} {uses[row].label}" for row in known.tolist()], dtype=str)
    apart = np.abs(positions[known, np.newaxis] - positions[known])
    near = np.linalg.norm(apart, axis=2) < max(size_m)
    alike = (does[:, np.newaxis] == does) & (apart[..., 2] < size_m[2] / 2)
    _, joined = connected_components(csr_array(near | alike), directed=False)
    first = {int(one): at for at, one in enumerate(dict.fromkeys(joined.tolist()))}
    found[known] = [first[int(one)] for one in joined]
    return found


def describe_places(
    uses: Sequence[BlockUse], poses: FloatArray, places: IntArray
) -> tuple[Place, ...]:
    """Name places, and put what stood there in order.

    Parameters
    ----------
    uses : sequence of BlockUse
    poses : array, shape (U, 7)
        Of the middle of each one's object; NaN in the world.
    places : array, shape (U,)
        Of `find_places`.
    """
    rows = [np.flatnonzero(places == at) for at in range(int(places.max(initial=-1)) + 1)]
    names = name_places([_labels(uses, own) for own in rows])
    return tuple(
        Place(name, poses[own[_from_midst(poses[own, :3])]])
        for name, own in zip(names, rows, strict=True)
    )


def name_places(labels: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Name places by the words that the labels of their own blocks share, and no others have.

    ``move_obj_table`` beside ``move_obj_shelf`` is the table. Where there is no such word it is the
    first label; places of one name are numbered.

    Parameters
    ----------
    labels : sequence of sequence of str
        Of the blocks that lead to each place.
    """
    names = []
    for own in labels:
        others = {w for some in labels for one in some if one not in own for w in _words(one)}
        shared = [w for w in _words(own[0]) if all(w in _words(one) for one in own)]
        alone = [w for w in shared if w not in others]
        names.append("_".join(alone) if others and alone else own[0])
    return tuple(
        name if names.count(name) == 1 else f"{name}_{names[: at + 1].count(name)}"
        for at, name in enumerate(names)
    )


def _labels(uses: Sequence[BlockUse], rows: IntArray) -> list[str]:
    """Return the labels of blocks that put something there; if none does, that lead there."""
    own = [uses[int(row)] for row in rows]
    return sorted({u.label for u in own if u.frame == "target"} or {u.label for u in own})


def _words(label: str) -> list[str]:
    return [word for word in label.split("_") if word]


def _from_midst(positions: FloatArray) -> IntArray:
    """Return the indices of positions, the one that is nearest to the median of all first.

    Of two that are as near the earlier one: rounding does not choose, as it would of any two.
    """
    away = np.linalg.norm(positions - np.median(positions, axis=0), axis=1)
    return np.argsort(np.round(away, 9), kind="stable")
