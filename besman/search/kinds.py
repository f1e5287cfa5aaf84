"""The searches there are, by name; a new one is a module of this folder and its entry here.

Nothing is imported before a search is set up, so that help texts can name them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pkgutil import resolve_name
from typing import Any


@dataclass(frozen=True)
class SearchKind:
    """A search: one entry of `SEARCHES` or `CONTEXTUAL_SEARCHES`.

    Attributes
    ----------
    name : str
        As in YAML and on the command line.
    search : str
        Its class, ``module:Class`` of ``besman.search``: of points a
        `besman.search.protocol.Search`, of policies a `besman.search.contextual.ContextualSearch`.
    about : str
        What it is.
    config : str
        Of a search of points: the class with its keys in YAML, one of those in
        ``stages/refine/methods.py``.
    also : tuple of str
        Other spellings, with the same meaning.
    """

    name: str
    search: str
    about: str
    config: str = ""
    also: tuple[str, ...] = ()

    def load(self) -> Any:
        """Return its class."""
        return resolve_name(f"{__package__}.{self.search}")


SEARCHES = (
    SearchKind("cma_es", "cma_es:CmaEs", "CMA-ES, which may restart", "CmaEsConfig"),
    SearchKind(
        "gauss_newton",
        "gauss_newton:GaussNewton",
        "Gauss-Newton on the outcomes, with one Jacobian for all motions; then CMA-ES",
        "GaussNewtonConfig",
    ),
    SearchKind("reps", "reps:Reps", "relative entropy policy search", "RepsConfig"),
    SearchKind("pi2", "pi2:Pi2", "policy improvement with path integrals", "Pi2Config"),
    SearchKind("pi2_cma", "pi2:Pi2Cma", "PI2 that adapts its covariance", "Pi2CmaConfig"),
    SearchKind("cem", "cem:Cem", "cross-entropy method", "CemConfig"),
)
"""Searches for the best point: ``refine: {method: ...}``."""

CONTEXTUAL_SEARCHES = (
    SearchKind("c_reps", "contextual_reps:ContextualReps", "contextual REPS", also=("creps",)),
    SearchKind(
        "c_cma_es", "contextual_cma_es:ContextualCmaEs", "contextual CMA-ES", also=("ccma_es",)
    ),
)
"""Searches for a policy that gives the best point for every context: templates."""

SEARCH_NAMES = tuple(entry.name for entry in SEARCHES)
CONTEXTUAL_NAMES = tuple(entry.name for entry in CONTEXTUAL_SEARCHES)

_KINDS = {
    spelling: entry
    for entry in (*SEARCHES, *CONTEXTUAL_SEARCHES)
    for spelling in (entry.name, *entry.also)
}


def search_kind(name: str) -> SearchKind:
    """Return the entry of a search; `name` is one of its spellings."""
    return _KINDS[name]


def usual_spelling(name: str) -> str:
    """Return a search's name by any of its spellings; what is none is returned as it is."""
    return _KINDS[name].name if name in _KINDS else name
