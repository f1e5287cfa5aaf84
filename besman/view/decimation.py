"""Meshes with fewer triangles, for pictures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_FINEST_M, _COARSER = 0.0005, 1.25


class Mesh(NamedTuple):
    """A mesh of triangles.

    Attributes
    ----------
    vertices : array, shape (V, 3)
        Metres.
    triangles : int array, shape (F, 3)
        Vertices of each, counter-clockwise seen from outside.
    """

    vertices: FloatArray
    triangles: IntArray


def decimate(meshes: list[Mesh], most: int) -> list[Mesh]:
    """Merge vertices until all meshes together have at most so many triangles.

    The cells of a grid become ever coarser, the same for all meshes.

    Parameters
    ----------
    meshes : list of Mesh
    most : int
        Triangles.

    Returns
    -------
    list of Mesh
        In their order; a mesh smaller than a cell has no triangles left.

    References
    ----------
    J. Rossignac, P. Borrel: Multi-resolution 3D approximations for rendering complex scenes, 1993,
    section 3. doi:10.1007/978-3-642-78114-8_29
    """
    found = meshes
    cell = _FINEST_M
    while sum(len(mesh.triangles) for mesh in found) > most:
        found = [_merge(mesh, cell) for mesh in meshes]
        cell *= _COARSER
    return found


def _merge(mesh: Mesh, cell: float) -> Mesh:
    """Replace the vertices in each cell (metres) of a grid by their mean."""
    keys = np.floor(mesh.vertices / cell).astype(np.int64)
    _, place, counts = np.unique(_as_numbers(keys), return_inverse=True, return_counts=True)
    vertices = np.zeros((len(counts), 3))
    np.add.at(vertices, place, mesh.vertices)
    triangles = place[mesh.triangles]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    # Two triangles may have become one; the first of its corners tells nothing.
    first = triangles.argmin(axis=1)[:, None]
    turned = np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1)
    triangles = turned[np.unique(_as_numbers(turned), return_index=True)[1]]
    used, again = np.unique(triangles, return_inverse=True)
    return Mesh((vertices / counts[:, None])[used], again.reshape(-1, 3))


def _as_numbers(rows: IntArray) -> IntArray:
    """Give each row (N, 3) a number, as equal and in the same order: sorted ten times as fast."""
    if not len(rows):
        return np.empty(0, np.int64)
    low = rows.min(axis=0)
    first, second, third = (int(one) for one in rows.max(axis=0) - low + 1)
    if first * second * third >= 2**62:
        # Too far apart for one number.
        return np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1)
    numbers: IntArray = (rows - low) @ np.array([second * third, third, 1])
    return numbers
