"""Which of the marker sets there are fit the names of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from besman.config.resources import resource_folder
from besman.exceptions import LabellingError
from besman.person.marker_set import MarkerSet, load_marker_set, normalise_name
from besman.person.point_frames import PointFrames


@dataclass(frozen=True)
class SetFit:
    """How a marker set fits.

    Attributes
    ----------
    marker_set : MarkerSet
    found : dict of str to str
        Of each marker that is there, how the file calls it.
    missing : tuple of str
        Required markers that are not there.
    fault : str
        Why names cannot be taken at all; empty if they can.
    """

    marker_set: MarkerSet
    found: dict[str, str]
    missing: tuple[str, ...]
    fault: str = ""

    @property
    def is_complete(self) -> bool:
        """Whether all that the set requires is there."""
        return not self.missing and not self.fault

    @property
    def aliases(self) -> dict[str, str]:
        """Of each marker that the file calls otherwise, how it calls it."""
        return {
            marker: name
            for marker, name in self.found.items()
            if normalise_name(marker) != normalise_name(name)
        }

    @property
    def absent(self) -> tuple[str, ...]:
        """Markers that may be missing, and are."""
        known = (*self.found, *self.missing)
        return tuple(name for name in self.marker_set.markers if name not in known)

    @property
    def rank(self) -> tuple[bool, float, int, int, float]:
        """What counts when sets are compared, the better the greater."""
        required = self.marker_set.required
        share = 1.0 - len(self.missing) / len(required)
        n_found, n_all = len(self.found), len(self.marker_set.markers)
        frames = self.marker_set.frames
        n_assumed = len(frames.find_assumptions(self.found)) if frames is not None else 0
        return self.is_complete, share, -n_assumed, n_found, n_found / n_all


def list_marker_sets() -> tuple[str, ...]:
    """Return the names of all marker sets that besman brings along."""
    folder = resource_folder("configs") / "markers"
    return tuple(sorted(path.stem for path in folder.glob("*.yaml")))


def fit_marker_sets(
    names: Sequence[str | None], source: str, has_orientations: bool = False
) -> tuple[SetFit, ...]:
    """Hold the names of a recording against all marker sets.

    Parameters
    ----------
    names : sequence of str or None
        Names of the trajectories as written in the file.
    source : str
        Of the recording, for messages.
    has_orientations : bool
        Whether the recording holds how bodies are turned. Sets of suits and exoskeletons need it.

    Returns
    -------
    tuple of SetFit
        The best first; a set of which no marker is there is left out.
    """
    sets = (load_marker_set(name) for name in list_marker_sets())
    fits = (fit_marker_set(one, names, source, has_orientations) for one in sets)
    return tuple(sorted((fit for fit in fits if fit.found), key=lambda fit: fit.rank, reverse=True))


def fit_marker_set(
    marker_set: MarkerSet,
    names: Sequence[str | None],
    source: str,
    has_orientations: bool = False,
) -> SetFit:
    """Hold the names of a recording against one marker set."""
    fault = ""
    frames = marker_set.frames
    points_tell = marker_set.clusters or isinstance(frames, PointFrames)
    if not (has_orientations or points_tell):
        fault = "nothing tells how a hand is turned: the set needs orientations"
    try:
        columns = marker_set.find(names, source)
    except LabellingError as error:
        fault, columns = str(error).partition("; see:")[0], {}
        for column, name in enumerate(names):
            for marker in marker_set.find((name,), source):
                columns.setdefault(marker, column)
    found = {marker: str(names[column]) for marker, column in columns.items()}
    missing = tuple(marker for marker in marker_set.required if marker not in found)
    return SetFit(marker_set, found, missing, fault)
