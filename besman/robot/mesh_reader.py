"""Meshes that are read once, however often they are asked for."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

IntArray = npt.NDArray[np.int64]

_triangles: WeakKeyDictionary[Any, IntArray] = WeakKeyDictionary()


class MeshReader:
    """Reads meshes for coal, each once.

    Attributes
    ----------
    loader : coal.MeshLoader
        For Pinocchio. Boxes alone (OBB) say the same as with spheres (OBBRSS), and sooner.
    """

    def __init__(self) -> None:
        import coal

        self.loader = coal.CachedMeshLoader(coal.BV_OBB)
        self._known: dict[tuple[str, tuple[float, ...]], Any] = {}

    def same(self, item: Any) -> Any:
        """Return the mesh of a GeometryObject: the same object for the same file and scale."""
        return self._known.setdefault((item.meshPath, tuple(item.meshScale)), item.geometry)


def triangles_of(mesh: Any) -> IntArray:
    """Return which vertices the triangles of coal's mesh have, shape (F, 3); read-only."""
    found = _triangles.get(mesh)
    if found is None:
        faces = map(mesh.tri_indices, range(mesh.num_tris))
        found = np.array([(face[0], face[1], face[2]) for face in faces], np.int64).reshape(-1, 3)
        found.setflags(write=False)
        _triangles[mesh] = found
    return found
