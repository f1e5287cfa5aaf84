"""Exact assignment of names to fragments: no two that share a frame get one name."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.stages.label.fragments import Fragments
from besman.stages.label.scores import GHOST

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_CANDIDATE_DEPTH = 25.0  # a name this much worse than the best is no candidate


def assign_fragments(fragments: Fragments, score: FloatArray) -> IntArray:
    """Give each fragment a name or none so that the sum of scores is greatest.

    No two fragments that share a frame get one name.

    Parameters
    ----------
    fragments : Fragments
        Sorted by first frame.
    score : array, shape (N, M)
        Worth of each name; no name is worth 0.

    Returns
    -------
    int array, shape (N,)
        Marker or `GHOST`.
    """
    best = score.max(axis=1)
    candidate = (score > 0.0) & (score > best[:, None] - _CANDIDATE_DEPTH)
    labels = np.where(best > 0.0, score.argmax(axis=1), GHOST)
    if not _has_conflict(fragments, labels, score.shape[1]):
        return labels
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    fragment, marker = np.nonzero(candidate)
    clique_variable, clique = _find_cliques(fragments, fragment, marker, score.shape[1])
    n_variables = len(fragment)
    # Components without a conflict keep their best names; only the others need a solver.
    n_cliques = int(clique.max(initial=-1)) + 1
    links = csr_array(
        (
            np.ones(n_variables + len(clique)),
            (
                np.concatenate((np.arange(n_variables), clique_variable)),
                np.concatenate((n_variables + fragment, n_variables + len(score) + clique)),
            ),
        ),
        shape=(n_variables + len(score) + n_cliques,) * 2,
    )
    _, component = connected_components(links, directed=False)
    greedy = labels[fragment] == marker
    load = np.bincount(clique, greedy[clique_variable], n_cliques)
    clique_component = component[n_variables + len(score) :]
    broken = np.isin(component[:n_variables], clique_component[load > 1])
    labels[fragment[broken]] = GHOST
    chosen = _solve(
        score[fragment[broken], marker[broken]], fragment[broken], clique_variable, clique, broken
    )
    picked = np.flatnonzero(broken)[chosen]
    labels[fragment[picked]] = marker[picked]
    return labels


def _has_conflict(fragments: Fragments, labels: IntArray, n_markers: int) -> bool:
    """Say whether two fragments with one name share a frame."""
    for marker in range(n_markers):
        member = np.flatnonzero(labels == marker)
        if np.any(fragments.start[member[1:]] < np.maximum.accumulate(fragments.stop[member])[:-1]):
            return True
    return False


def _find_cliques(
    fragments: Fragments, fragment: IntArray, marker: IntArray, n_markers: int
) -> tuple[IntArray, IntArray]:
    """List the sets of candidates that exclude each other: (variable, clique) pairs.

    At the birth of each candidate, those alive with the same name are one set; every two
    candidates that overlap are in one of these.
    """
    variables, cliques = [], []
    n_cliques = 0
    for name in range(n_markers):
        member = np.flatnonzero(marker == name)
        start, stop = fragments.start[fragment[member]], fragments.stop[fragment[member]]
        n_later = np.searchsorted(start, stop, side="left") - np.arange(len(member)) - 1
        first = np.repeat(np.arange(len(member)), n_later)
        second = (
            first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(n_later) - n_later, n_later)
        )
        newest = np.unique(second)
        index = np.searchsorted(newest, second)
        variables += [member[first], member[newest]]
        cliques += [n_cliques + index, n_cliques + np.arange(len(newest))]
        n_cliques += len(newest)
    return np.concatenate(variables), np.concatenate(cliques)


def _solve(
    worth: FloatArray,
    fragment: IntArray,
    clique_variable: IntArray,
    clique: IntArray,
    kept: npt.NDArray[np.bool_],
) -> npt.NDArray[np.bool_]:
    """Choose the candidates of greatest worth that do not exclude each other."""
    from scipy.optimize import Bounds, LinearConstraint, milp
    from scipy.sparse import csr_array

    inside = kept[clique_variable]
    column = (np.cumsum(kept) - 1)[clique_variable[inside]]
    _, clique_row = np.unique(clique[inside], return_inverse=True)
    _, fragment_row = np.unique(fragment, return_inverse=True)
    n_fragments = int(fragment_row.max()) + 1
    row = np.concatenate((fragment_row, n_fragments + clique_row))
    column = np.concatenate((np.arange(len(worth)), column))
    matrix = csr_array((np.ones(len(row)), (row, column)))
    answer = milp(
        -worth,
        integrality=np.ones(len(worth)),
        bounds=Bounds(0.0, 1.0),
        constraints=LinearConstraint(matrix, -np.inf, 1.0),
    )
    chosen: npt.NDArray[np.bool_] = answer.x > 0.5
    return chosen
