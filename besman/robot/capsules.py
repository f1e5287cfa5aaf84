"""Capsules that enclose the collision mesh of a link."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_GREATEST_NUMBER = 3
# A further capsule costs time in every distance query, so it must save this share of the volume.
_WORTH = 0.85
_ROUNDS = 12
# Of fewer points the hull costs more than it saves.
_HULL_FROM = 40
# A finer mesh is fitted by a coarser one, and what then sticks out is enclosed in the end.
_MOST_TRIANGLES = 3000
_CELLS = 40
_MOST_HALVED = 20_000


def fit_capsules(vertices: FloatArray, triangles: IntArray) -> list[tuple[FloatArray, float]]:
    """Enclose a mesh in up to three capsules of small volume.

    Every triangle lies wholly inside at least one capsule, so the surface does too.

    Parameters
    ----------
    vertices : array, shape (V, 3)
        Metres.
    triangles : int array, shape (F, 3)
        Indices of vertices.

    Returns
    -------
    list of (ends, radius)
        Ends of the axis, shape (2, 3), and radius, metres.
    """
    best: list[tuple[FloatArray, float]] = []
    least = np.inf
    is_fine = len(triangles) > _MOST_TRIANGLES
    coarse = coarser_mesh(vertices, triangles)
    for number in range(1, _GREATEST_NUMBER + 1):
        capsules = _fit_clusters(*coarse, number)
        if is_fine:
            capsules = contain(capsules, vertices, triangles)
        volume = sum(_volume(ends, radius) for ends, radius in capsules)
        if volume < _WORTH * least:
            best, least = capsules, volume
    return best


def _thin(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Return a mesh with one vertex in every cell of a grid, none of the old ones' triangles lost.

    References
    ----------
    J. Rossignac and P. Borrel: Multi-resolution 3D approximations for rendering complex scenes,
    1993, doi:10.1007/978-3-642-78114-8_29
    """
    used = np.unique(triangles)
    low = vertices[used].min(axis=0)
    cell = max(float(np.ptp(vertices[used], axis=0).max()) / _CELLS, 1e-9)
    grid = np.floor((vertices[used] - low) / cell).astype(np.int64)
    _, first, place = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    where = np.zeros(len(vertices), dtype=np.int64)
    where[used] = place.ravel()
    return vertices[used][first], np.unique(np.sort(where[triangles], axis=1), axis=0)


def contain(
    capsules: list[tuple[FloatArray, float]], vertices: FloatArray, triangles: IntArray
) -> list[tuple[FloatArray, float]]:
    """Widen capsules until every triangle lies wholly in the one it sticks out of least."""
    excess = np.stack([distances_to_axis(vertices, ends) - radius for ends, radius in capsules])
    outside = excess[:, triangles].max(axis=2)
    owner = np.argmin(outside, axis=0)
    return [
        (ends, radius + max(float(outside[own, owner == own].max(initial=0.0)), 0.0))
        for own, (ends, radius) in enumerate(capsules)
    ]


def _hull(points: FloatArray) -> FloatArray:
    """Return the points that no others enclose: a capsule around them encloses all."""
    if len(points) < _HULL_FROM:
        return points
    # Only arms without stored capsules need it.
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners: FloatArray = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        # Flat.
        return points
    return corners


def fit_capsule(points: FloatArray) -> tuple[FloatArray, float]:
    """Enclose points in one capsule of small volume.

    The axis is parallel to a coordinate axis, to a principal axis of the points or to one of
    forty spread over all directions, and passes through the centre of the smallest circle around
    their projection.

    Parameters
    ----------
    points : array, shape (V, 3)
        Metres.

    Returns
    -------
    ends : array, shape (2, 3)
        Metres.
    radius : float
        Metres.
    """
    points = np.ascontiguousarray(_hull(points))
    principal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    ends = np.zeros((2, 3))
    # Only arms without stored capsules need it, and numba takes longer to import.
    from besman.robot.capsule_kernel import fit_along

    radius = fit_along(points, np.vstack([np.eye(3), principal, _DIRECTIONS]), ends)
    return ends, max(radius, float(np.max(distances_to_axis(points, ends))))


def fill_sphere(count: int) -> FloatArray:
    """Return unit vectors spread evenly over a sphere (Fibonacci's spiral), shape (count, 3)."""
    index = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * index / count), np.pi * (1 + np.sqrt(5)) * index
    rim = np.sin(polar)
    return np.stack([np.cos(turn) * rim, np.sin(turn) * rim, np.cos(polar)], axis=1)


# An axis and its opposite are one.
_DIRECTIONS = fill_sphere(80)[:40]


def subdivide(
    vertices: FloatArray, triangles: IntArray, share: float
) -> tuple[FloatArray, IntArray]:
    """Halve edges until none is longer than a share of the mesh's greatest extent."""
    longest = share * max(float(np.ptp(vertices[triangles].reshape(-1, 3), axis=0).max()), 1e-9)
    while len(triangles) < _MOST_HALVED:
        corners = vertices[triangles]
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        big = edges.max(axis=1) > longest
        if not big.any():
            break
        halved, row = triangles[big], np.arange(int(big.sum()))
        start = edges[big].argmax(axis=1)
        a, b, c = (halved[row, (start + shift) % 3] for shift in range(3))
        middle = len(vertices) + row
        vertices = np.vstack([vertices, (vertices[a] + vertices[b]) / 2])
        parts = [np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)]
        triangles = np.vstack([triangles[~big], *parts])
    return vertices, triangles


def coarser_mesh(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Return a coarser mesh if there are too many triangles to fit many capsules to."""
    return _thin(vertices, triangles) if len(triangles) > _MOST_TRIANGLES else (vertices, triangles)


def distances_to_axis(points: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the distances of points (V, 3) to a segment (2, 3), shape (V,)."""
    along = ends[1] - ends[0]
    share = np.clip((points - ends[0]) @ along / max(along @ along, 1e-12), 0.0, 1.0)
    distances: FloatArray = np.linalg.norm(points - ends[0] - share[:, None] * along, axis=1)
    return distances


def _volume(ends: FloatArray, radius: float) -> float:
    """Return a capsule's volume, m^3."""
    length = float(np.linalg.norm(ends[1] - ends[0]))
    return float(np.pi * radius**2 * (length + 4 / 3 * radius))


def _fit_clusters(
    vertices: FloatArray, triangles: IntArray, number: int
) -> list[tuple[FloatArray, float]]:
    """Share the triangles out among capsules, each to the one it sticks out of least."""
    centres = vertices[triangles].mean(axis=1)
    spread = np.linalg.svd(centres - centres.mean(axis=0), full_matrices=False)[2][0]
    along = centres @ spread
    low, high = along.min(), along.max()
    share = np.clip((along - low) / max(high - low, 1e-12), 0.0, 1.0 - 1e-9)
    owner = (share * number).astype(np.int64)
    best: list[tuple[FloatArray, float]] = []
    least = np.inf
    for _ in range(_ROUNDS):
        used = np.unique(owner)
        capsules = [fit_capsule(vertices[np.unique(triangles[owner == own])]) for own in used]
        volume = sum(_volume(ends, radius) for ends, radius in capsules)
        if volume < least:
            best, least = capsules, volume
        excess = np.stack([distances_to_axis(vertices, ends) - radius for ends, radius in capsules])
        moved = np.argmin(excess[:, triangles].max(axis=2), axis=0)
        if np.array_equal(moved, owner):
            break
        owner = moved
    return best
