"""Which markers a person wears and how files call them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from besman.config.resources import find_resource
from besman.config.stage import Config
from besman.config.yaml_file import load_config
from besman.exceptions import LabellingError, nearest, see_look
from besman.foreign.names import split_subject
from besman.person.body_frames import BodyFrames
from besman.person.mirror import find_side, mirror_name
from besman.person.point_frames import PointFrames

# How many names, and which share of all, have to begin alike for a person to be meant.
_LEAST_SHARED, _SHARE = 6, 0.8


class MarkerSet(Config):
    """Markers by canonical name.

    Attributes
    ----------
    name : str
    markers : dict of str to tuple of str
        Canonical names, each with its aliases.
    required : tuple of str
        Markers that every recording must have; all others are optional.
    clusters : dict of str to tuple of str
        Markers that move as one rigid body.
    roles : dict of str to str
        Which marker stands for ``hand``, ``elbow`` and ``shoulder``, of the right arm where there
        are two, and for ``left_hand``, ``left_elbow`` and ``left_shoulder``. Stages look at these
        unless their section names markers itself.
    objects : dict of str to tuple of str
        Markers on objects.
    pose_m : dict of str to (x, y, z)
        Where the markers are in the initial pose, metres, in any frame with z up. From it
        trajectories can be named where there is no recording to learn from.
    distances_m : dict of str to (dict of str to float)
        Distances that hardly change, such as lengths of limbs, metres.
    frames : PointFrames or BodyFrames, optional
        Where there are no clusters: from which points back and hands are derived, as the markers
        ``back_top``, ``hand_top`` and so on; see `besman.person.point_frames`. Of a robot arm in
        place of a person: which links are its base and its hand.
    side : "right" or "left"
        The hand that the person works with. A recording of a left-handed person is mirrored, names
        and positions, and is from then on that of a right-handed one.
    """

    name: str
    markers: dict[str, tuple[str, ...]]
    required: tuple[str, ...]
    clusters: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    roles: dict[str, str] = Field(default_factory=dict)
    objects: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    pose_m: dict[str, tuple[float, float, float]] = Field(default_factory=dict)
    distances_m: dict[str, dict[str, Annotated[float, Field(gt=0.0)]]] = Field(default_factory=dict)
    frames: PointFrames | BodyFrames | None = None
    side: Literal["right", "left"] = "right"

    @field_validator("markers")
    @classmethod
    def _check_names(cls, markers: dict[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
        """Refuse a spelling that could mean two markers."""
        owners: dict[str, str] = {}
        for marker, aliases in markers.items():
            for spelling in (marker, *aliases):
                owner = owners.setdefault(normalise_name(spelling), marker)
                if owner != marker:
                    raise ValueError(f"{spelling!r} names both {owner!r} and {marker!r}")
        return markers

    @model_validator(mode="after")
    def _check_references(self) -> MarkerSet:
        """Refuse a group that names a marker which is not there."""
        groups = [
            ("required", self.required),
            *((f"clusters.{name}", group) for name, group in self.clusters.items()),
            ("roles", tuple(one for one in self.roles.values() if one not in self.derived)),
            *((f"objects.{name}", group) for name, group in self.objects.items()),
            ("pose_m", tuple(self.pose_m)),
            ("distances_m", tuple(self.distances_m)),
            *((f"distances_m.{name}", tuple(group)) for name, group in self.distances_m.items()),
            ("frames", self.frames.points if self.frames else ()),
        ]
        for place, group in groups:
            for marker in group:
                if marker not in self.markers:
                    raise ValueError(
                        f"{place}: no marker {marker!r}; {nearest(marker, self.markers)}"
                    )
        return self

    @property
    def derived(self) -> tuple[str, ...]:
        """Names of the markers that `frames` adds."""
        if self.frames is None:
            return ()
        return tuple(name for name in self.frames.names if name not in self.markers)

    @property
    def hand(self) -> tuple[str, ...]:
        """Marker of the hand whose movement is segmented, none if no role says so."""
        return tuple(self.roles[role] for role in ("hand",) if role in self.roles)

    @property
    def hands(self) -> tuple[str, ...]:
        """Markers of all hands."""
        return tuple(self.roles[role] for role in ("hand", "left_hand") if role in self.roles)

    @property
    def arms(self) -> tuple[str, ...]:
        """Markers of hand, elbow and shoulder of all arms."""
        roles = [
            f"{side}{part}" for side in ("", "left_") for part in ("hand", "elbow", "shoulder")
        ]
        return tuple(self.roles[role] for role in roles if role in self.roles)

    def match(self, names: Sequence[str | None], source: str) -> dict[str, int]:
        """Find the markers among the trajectories of a recording; all required ones are there.

        Parameters and result are those of `find`.

        Raises
        ------
        LabellingError
            If a required marker is not there, or two trajectories stand for one marker.
        """
        found = self.find(names, source)
        missing = [marker for marker in self.required if marker not in found]
        if missing:
            there = ", ".join(sorted(name for name in names if name)) or "no named trajectory"
            raise LabellingError(
                f"{source}: marker {missing[0]!r} of {self.name} is not there; got: {there}"
                + see_look(source)
            )
        return found

    def find(self, names: Sequence[str | None], source: str) -> dict[str, int]:
        """Find the markers among the trajectories of a recording.

        Parameters
        ----------
        names : sequence of str or None
            Names of the trajectories as written in the file.
        source : str
            Named in errors.

        Returns
        -------
        dict of str to int
            Index of the trajectory of every marker that is there, in the order of the set.

        Raises
        ------
        LabellingError
            If two trajectories stand for one marker; of joints and keypoints of one person that
            of the first alias is taken.
        """
        owners = {
            normalise_name(spelling): (marker, rank)
            for marker, aliases in self.markers.items()
            for rank, spelling in enumerate((marker, *aliases))
        }
        found: dict[str, int] = {}
        ranks: dict[str, int] = {}
        prefix = _find_prefix(names)
        for index, name in enumerate(names):
            worn = mirror_name(name or "") if self.side == "left" else name or ""
            bare = without_subject(worn)
            spellings = (worn, bare, bare.removeprefix(prefix))
            known = (owners.get(normalise_name(spelling)) for spelling in spellings)
            marker, rank = next((one for one in known if one is not None), ("", 0))
            if not marker:
                continue
            if marker in found:
                self._check_twins(marker, names[found[marker]] or "", name or "", source)
                if rank > ranks[marker]:
                    continue
            found[marker], ranks[marker] = index, rank
        return {marker: found[marker] for marker in self.markers if marker in found}

    def _check_twins(self, marker: str, other: str, name: str, source: str) -> None:
        """Refuse two trajectories for a marker, unless they are of a skeleton that has both.

        Of joints and keypoints (`frames`) the one counts whose alias stands first: programs call a
        part by several names, and some skeletons have several such parts in a row.
        """
        owners = [split_subject(one)[0] for one in (other, name)]
        same = normalise_name(other) == normalise_name(name)
        if self.frames is not None and owners[0] == owners[1] and not same:
            return
        choose = ""
        if owners[0] != owners[1]:
            named = " or ".join(repr(one) for one in owners if one)
            choose = f": choose with --subject {named}, in a recipe with read.subject"
        raise LabellingError(
            f"{source}: trajectories {other!r} and {name!r} both stand for "
            f"marker {marker!r} of {self.name}; expected one{choose}" + see_look(source)
        )


def _find_prefix(names: Sequence[str | None]) -> str:
    """Return what nearly all names begin with, such as ``Ann_``; empty if they do not."""
    bare = [without_subject(name) for name in names if name]
    parts = Counter(before for name in bare if (before := name.partition("_")[0]) != name)
    shared, count = parts.most_common(1)[0] if parts else ("", 0)
    is_shared = count >= max(_LEAST_SHARED, _SHARE * len(bare)) and not find_side(f"{shared}_x")
    return f"{shared}_" if is_shared else ""


def without_subject(name: str) -> str:
    """Return a name without the person or thing it belongs to: ``Ann:RELB``, ``Skeleton_001_Hip``.

    Parameters
    ----------
    name : str

    Returns
    -------
    str
        What stands after the last colon; the name itself where nothing stands before it.
    """
    return split_subject(name)[1]


def normalise_name(name: str) -> str:
    """Reduce a name to what counts when names are compared: letters and digits in lower case."""
    return re.sub(r"[\s_-]+", "", name).lower()


def load_marker_set(name: str) -> MarkerSet:
    """Load a marker set of ``configs/markers`` by name, or a user's own by the path of its file.

    Raises
    ------
    ConfigError
        If there is no such file, or it has a mistake; the message names file and line.
    """
    return load_config(Path(find_resource("configs/markers", name)), MarkerSet)
