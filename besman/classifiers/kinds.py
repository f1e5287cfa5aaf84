"""The classifiers of segments there are, by name.

Nothing is imported before a classifier is made, so that help texts can name them.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pkgutil import resolve_name
from typing import Any


@dataclass(frozen=True)
class ClassifierKind:
    """A classifier: one entry of `CLASSIFIERS`.

    Attributes
    ----------
    name : str
        As in YAML and on the command line.
    classifier : str
        Its class, ``module:Class`` of this folder.
    about : str
        What it is.
    library : str
        Package that it needs.
    extra : str
        What brings that package, if installing besman does not: ``pip install besman[EXTRA]``.
    is_sequential : bool
        Whether it looks at a segment as a sequence of points with so many channels.
    learns_parameters : bool
        Whether it sums up its examples in parameters, and gives probabilities.
    """

    name: str
    classifier: str
    about: str
    library: str = "sklearn"
    extra: str = ""
    is_sequential: bool = True
    learns_parameters: bool = False

    @property
    def is_installed(self) -> bool:
        """Whether the package that it needs is there."""
        return find_spec(self.library) is not None

    def make(self, settings: dict[str, Any], n_channels: int) -> Any:
        """Return it untrained, under scikit-learn's interface."""
        arguments = (n_channels,) if self.is_sequential else ()
        return resolve_name(f"{__package__}.{self.classifier}")(*arguments, **settings)


CLASSIFIERS = (
    ClassifierKind(
        "nearest_neighbour",
        "neighbours:NearestNeighbours",
        "nearest neighbours; their distance is the uncertainty",
        is_sequential=False,
    ),
    ClassifierKind(
        "dtw",
        "neighbours:DtwNeighbour",
        "nearest neighbour under dynamic time warping",
        "numba",
    ),
    ClassifierKind(
        "hmm",
        "hmm:HmmClassifier",
        "one hidden Markov model a class",
        "hmmlearn",
        "sequences",
        learns_parameters=True,
    ),
    ClassifierKind(
        "lstm",
        "lstm:LstmClassifier",
        "a network with long short-term memory",
        "torch",
        "lstm",
        learns_parameters=True,
    ),
)
"""All classifiers; the first one is taken where none is named."""

CLASSIFIER_NAMES = tuple(entry.name for entry in CLASSIFIERS)

_KINDS = {entry.name: entry for entry in CLASSIFIERS}


def classifier_kind(name: str) -> ClassifierKind:
    """Return the entry of a classifier."""
    return _KINDS[name]
