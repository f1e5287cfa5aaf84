"""A marker set proposed from a recording, to be mended by hand."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.exceptions import LabellingError
from besman.geometry.gaps import BoolArray
from besman.geometry.rigid_groups import find_rigid_groups
from besman.io.atomic_files import check_file, write_text
from besman.io.recordings.formats import read_recording
from besman.person.body_words import guess_part
from besman.person.marker_set import MarkerSet, load_marker_set, normalise_name, without_subject
from besman.records import FloatArray, Recording

_SEEN = 0.9  # of the frames: what is hidden more cannot be required
_LINE = 98
_STEP_S = 0.1  # between places of which a way is made


def write_marker_set(path: Path, out: Path) -> MarkerSet:
    """Propose a marker set and write it.

    Parameters
    ----------
    path : Path
        A recording.
    out : Path
        File to write, ``.yaml``; must not be there yet.

    Returns
    -------
    MarkerSet
        As it was written.

    Raises
    ------
    BesmanError
        If the recording cannot be read or shows nothing, or the file cannot be written.
    """
    if out.suffix != ".yaml":
        raise LabellingError(f"{out}: got ending {out.suffix!r}, expected .yaml")
    if out.exists():
        raise LabellingError(f"{out}: is there already; give another name with --out")
    check_file(out)
    recording = read_recording(path)
    write_text(out, propose_set(recording, re.sub(r"[^a-z0-9_]+", "_", out.stem.lower())))
    return load_marker_set(str(out))


def propose_set(recording: Recording, name: str) -> str:
    """Return a marker set as YAML: what was guessed is said in comments.

    Clusters are what moves rigidly; parts of the body are told by names that labs use, sides by
    names of which there is a left and a right one. Trajectories without names get numbers, and
    their places at one moment as the initial pose.

    Parameters
    ----------
    recording : Recording
    name : str
        Of the set.

    Raises
    ------
    LabellingError
        If nothing is ever seen in it.
    """
    seen: BoolArray = np.all(np.isfinite(recording.positions), axis=2)
    columns = np.flatnonzero(seen.any(axis=0))
    if not len(columns):
        raise LabellingError(f"{recording.source}: no marker is ever seen in it")
    whole = _keep_owners([recording.names[column] for column in columns])
    markers = _name_markers(whole)
    shares = seen[:, columns].mean(axis=0)
    clusters = [
        tuple(markers[one] for one in group)
        for group in find_rigid_groups(recording.positions[:, columns])
    ]
    lines = [
        *_wrap(
            f"# Proposed from {recording.source!r}: mend it by hand. Case, spaces, underscores and "
            "hyphens of names do not matter, nor what stands before a colon."
        ),
        f"name: {json.dumps(name)}",
        "markers:",
    ]
    lines += _write_aliases(whole, markers)
    required = [marker for marker, share in zip(markers, shares, strict=True) if share >= _SEEN]
    parts = _find_parts([recording.names[column] for column in columns], markers)
    frames = _write_frames(parts)
    if frames:
        required = [marker for marker in markers if marker in _with_side(parts)]
    where = "on the arms" if frames else f"seen in {100 * _SEEN:g} % of the frames"
    lines.append(f"# Guessed: {where}.")
    lines += _wrap(f"required: [{', '.join(required)}]")
    lines += _write_clusters(clusters)
    ways = measure_ways(recording.positions[:, columns], recording.rate_hz)
    travelled = dict(zip(markers, ways.tolist(), strict=True))
    lines += frames or _take_roles(markers) or _ask_for_roles(parts, clusters, travelled)
    if all(recording.names[column] is None for column in columns):
        lines += _write_pose(recording, columns, markers)
    return "\n".join(lines) + "\n"


def _keep_owners(names: Sequence[str | None]) -> list[str | None]:
    """Return names without whose they are, but for those that would then be alike.

    Motive calls the markers of every rigid body alike: ``Hand:Marker1``, ``Back:Marker1``.
    """
    bare = [normalise_name(without_subject(name or "")) for name in names]
    return [
        name if name is None or bare.count(one) > 1 else without_subject(name)
        for name, one in zip(names, bare, strict=True)
    ]


def _write_aliases(names: Sequence[str | None], markers: Sequence[str]) -> list[str]:
    """Return every marker with what it is called, where that is not the same."""
    spellings = {normalise_name(marker) for marker in markers}
    lines = []
    for name, marker in zip(names, markers, strict=True):
        called = name or ""
        differs = called and normalise_name(called) not in spellings
        spellings.add(normalise_name(called))
        lines.append(f"  {marker}: [{json.dumps(called) if differs else ''}]")
    return lines


def _name_markers(names: Sequence[str | None]) -> list[str]:
    """Return a name of its own for every trajectory, of small letters, digits and underscores."""
    found: list[str] = []
    taken: set[str] = set()
    for number, name in enumerate(names, start=1):
        words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name or "")
        plain = re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_")
        plain = plain if plain[:1].isalpha() else f"marker_{plain or number}"
        other, count = plain, 1
        while normalise_name(other) in taken:
            count += 1
            other = f"{plain}_no_{count}"
        taken.add(normalise_name(other))
        found.append(other)
    return found


def _find_parts(names: Sequence[str | None], markers: Sequence[str]) -> dict[str, list[str]]:
    """Return the markers of each part: ``right_elbow``, ``elbow`` where no side is said."""
    parts: dict[str, list[str]] = {}
    for name, marker in zip(names, markers, strict=True):
        part, side = guess_part(name or "")
        if part:
            parts.setdefault(f"{side}_{part}".strip("_"), []).append(marker)
    return parts


def _with_side(parts: dict[str, list[str]]) -> set[str]:
    """Return the markers of parts of which the side is known."""
    sided = [group for part, group in parts.items() if part.startswith(("left_", "right_"))]
    return {one for group in sided for one in group}


def _write_frames(parts: dict[str, list[str]]) -> list[str]:
    """Return roles and frames where both shoulders and a whole right arm are known."""
    arms = {}
    for side, key, prefix in (("right", "hand", ""), ("left", "left_hand", "left_")):
        arm = {
            part: parts.get(f"{side}_{part}", [])
            for part in ("shoulder", "elbow", "wrist", "knuckle")
        }
        thumb = parts.get(f"{side}_wrist_thumb_side", [])
        little = parts.get(f"{side}_wrist_little_side", [])
        arm["wrist"] = arm["wrist"] or [*thumb, *little]
        if all(arm[part] for part in ("shoulder", "elbow", "wrist")):
            arms[key] = (prefix, arm, thumb, little)
    shoulders = [parts.get(f"{side}_shoulder", []) for side in ("left", "right")]
    if "hand" not in arms or not all(shoulders):
        return []
    roles = [
        f"{prefix}{role}: {prefix}{marker}"
        for prefix, *_ in arms.values()
        for role, marker in (("shoulder", "shoulder"), ("elbow", "elbow"), ("hand", "hand_top"))
    ]
    lines = ["# Guessed by names; back and hands are derived from single points."]
    lines += _wrap(f"roles: {{{', '.join(roles)}}}")
    lines += ["frames:", "  back:", f"    left: [{', '.join(shoulders[0])}]"]
    lines.append(f"    right: [{', '.join(shoulders[1])}]")
    for key, (_, arm, thumb, little) in arms.items():
        lines.append(f"  {key}:")
        groups = {**{p: arm[p] for p in ("shoulder", "elbow", "wrist")}, "fingers": arm["knuckle"]}
        if thumb and little:
            groups |= {"thumb_side": thumb, "little_side": little}
        lines += [f"    {k}: [{', '.join(group)}]" for k, group in groups.items() if group]
    return lines


def _take_roles(markers: Sequence[str]) -> list[str]:
    """Return roles where markers are called as in right_arm.yaml."""
    roles = {"shoulder": "shoulder", "elbow": "elbow", "hand": "hand_top"}
    if not set(roles.values()) <= set(markers):
        return []
    return [f"roles: {{{', '.join(f'{role}: {marker}' for role, marker in roles.items())}}}"]


def measure_ways(positions: FloatArray, rate_hz: float) -> FloatArray:
    """Return how far markers travel, shape (M,), metres, without what trembles between frames.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Metres; NaN where not seen.
    rate_hz : float
        Frames per second.
    """
    few = positions[:: max(1, round(_STEP_S * rate_hz))]
    steps = np.linalg.norm(np.diff(few, axis=0), axis=2)
    ways: FloatArray = np.nansum(steps, axis=0)
    return ways


def _ask_for_roles(
    parts: dict[str, list[str]], clusters: list[tuple[str, ...]], ways: dict[str, float]
) -> list[str]:
    """Return comments that say what a person has to add, and what movement tells of clusters."""
    moved = [sum(ways[one] for one in group) / len(group) for group in clusters]
    known = ", ".join(f"{part} {' '.join(group)}" for part, group in sorted(parts.items()))
    said = (
        "# Not told by names: which markers are shoulder, elbow and hand. Rename those of back and "
        "hand to back_top, back_left, back_right, hand_top, hand_left, hand_right and take them as "
        "clusters, as in right_arm.yaml; or say in frames what shoulder, elbow and wrist are, as "
        f"in halpe.yaml. Guessed so far: {known or 'nothing'}."
    )
    if len(moved) > 1 and max(moved) > 2.0 * min(moved):
        most, least = (1 + moved.index(pick(moved)) for pick in (max, min))
        said += (
            f" Of the clusters rigid_{most} travels farthest ({max(moved):.1f} m), as a hand does, "
            f"rigid_{least} least ({min(moved):.1f} m), as a back does."
        )
    return _wrap(said)


def _write_clusters(clusters: list[tuple[str, ...]]) -> list[str]:
    """Return the rigid clusters."""
    if not clusters:
        return ["# No three markers keep their distances: no clusters."]
    lines = ["# Guessed: their distances stay the same to 4 mm.", "clusters:"]
    for number, group in enumerate(clusters, start=1):
        lines += [f"  {line}" for line in _wrap(f"rigid_{number}: [{', '.join(group)}]")]
    return lines


def _write_pose(
    recording: Recording, columns: npt.NDArray[np.intp], markers: list[str]
) -> list[str]:
    """Return where markers are at the moment that shows most of them."""
    places = recording.positions[:, columns]
    row = int(np.isfinite(places).all(axis=2).sum(axis=1).argmax())
    frame = recording.first_frame + row
    lines = [f"# Where they are in frame {frame}, metres, z up.", "pose_m:"]
    for marker, place in zip(markers, places[row], strict=True):
        if np.isfinite(place).all():
            lines.append(f"  {marker}: [{', '.join(f'{one:.4f}' for one in place)}]")
    return lines


def _wrap(text: str) -> list[str]:
    """Break a long line; what follows a comment is one, what follows a list is indented."""
    from textwrap import wrap

    indent = "# " if text.startswith("#") else "    "
    return wrap(
        text, _LINE, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )
