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
    pose : array, shape (7,)
        Of an object's middle, in the robot's world: position (m) and quaternion wxyz; of all that
        stood there the one in their midst.
    """

    name: str
    pose: FloatArray


def find_places(positions: FloatArray, apart_m: float) -> IntArray:
    """Tell which positions are of one place: those that are joined by steps shorter than a length.

    Parameters
    ----------
    positions : array, shape (U, 3)
        Metres; NaN of what stands nowhere.
    apart_m : float

    Returns
    -------
    array, shape (U,)
        Index of each one's place, in the order in which places are first seen; -1 for NaN.
    """
    from scipy.cluster.hierarchy import fcluster, linkage

    found = np.full(len(positions), -1, dtype=np.int64)
    known = np.flatnonzero(np.isfinite(positions).all(axis=1))
    if len(known) < 2:
        found[known] = 0
        return found
    joined = fcluster(linkage(positions[known], "single"), apart_m, "distance")
    first = {int(one): at for at, one in enumerate(dict.fromkeys(joined.tolist()))}
    found[known] = [first[int(one)] for one in joined]
    return found


def describe_places(
    uses: Sequence[BlockUse], poses: FloatArray, places: IntArray
) -> tuple[Place, ...]:
    """Name places, and choose for each the pose in its midst.

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
        Place(name, poses[own[_midst(poses[own, :3])]])
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
    for at, own in enumerate(labels):
        others = {w for k, some in enumerate(labels) if k != at for one in some for w in _words(one)}
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


def _midst(positions: FloatArray) -> int:
    """Return the index of the position that is nearest to the median of all."""
    return int(np.argmin(np.linalg.norm(positions - np.median(positions, axis=0), axis=1)))
