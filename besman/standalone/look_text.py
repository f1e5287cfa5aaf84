"""What `besman look` prints: a page of one recording, a table of several; and how to go on."""

from __future__ import annotations

import shlex
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from besman.exceptions import RecordingWarning, pasted
from besman.io.segments_json import SEGMENTS_SUFFIX, find_segments, read_segments
from besman.person.marker_set_fit import SetFit
from besman.standalone import LONGEST_GAP_S
from besman.standalone.look_files import STILL_M, Look, measure_extent

if TYPE_CHECKING:
    from rich.table import Table

_MOST_GAPS, _MOST_MOVERS, _MOST_NAMES = 8, 4, 12
_WIDEST_NAME, _MOST_OTHERS = 32, 4
_REACH_LABEL = "approach_forward"  # what the recipe ur5_reach takes
_THROW_LABEL = "throw"  # what ur5_stick_throw takes
_BALL, _FLIES_M_S = "ball", 3.5  # faster than what is carried; what ur5_free_throw takes
_AT_REST = {"idle", "rest"}
_UP_BY_HABIT = "habit: nothing tells (--up y if it is y)"


def describe_look(look: Look, commands: list[str]) -> list[str]:
    """Return what there is to say of one recording, a line each.

    Parameters
    ----------
    look : Look
    commands : list of str
        How to go on.
    """
    recording, origin = look.recording, look.origin
    frames = len(recording.time)
    last = recording.first_frame + frames - 1
    writer = f", by {origin.writer}" if origin.writer else ""
    size = measure_extent(recording.positions)
    lines = [
        f"{look.path}",
        f"  format      {origin.format}{writer}",
        f"  time        {recording.rate_hz:g} Hz, {frames} frames "
        f"({recording.first_frame} to {last}), {look.duration_s:.4g} s",
        f"  units       {origin.units or 'metres'}, by {origin.units_by or 'the format'}; "
        f"all of it lies within {size[0]:.2f} x {size[1]:.2f} x {size[2]:.2f} m (z up)",
        f"  up          {origin.up}, by {origin.up_by or _UP_BY_HABIT}",
        f"  names       {_names(look)}",
        *_gaps(look),
        f"  movement    {_movement(look)}",
        *_landing(look),
        *_sets(look),
    ]
    lines += [f"  note        {note}" for note in origin.notes]
    lines += [
        f"  warning     {said.removeprefix(f'{recording.source}: ')}" for said in look.warnings
    ]
    if commands:
        lines += ["", "how to go on:", *(f"  {command}" for command in commands)]
    return lines


def find_next(look: Look, options: list[str]) -> list[str]:
    """Return commands that go on from here, the first the best; each can be pasted.

    Parameters
    ----------
    look : Look
    options : list of str
        How the recording had to be read, such as ``--up y``.
    """
    file = pasted(str(look.path))
    how = "".join(f" {shlex.quote(one)}" for one in options)
    stem = look.path.stem
    fit = look.best
    if fit is not None and fit.is_complete:
        if not look.fault or look.needed_gap_s:
            return _use_set(look, fit, file, how)
        # It would stop a run: first look what is wrong.
        if "upright" in look.fault and "--up" not in options:
            return [f"besman look {file} --up {'y' if look.origin.up == 'z' else 'z'}{how}"]
        return [f"besman look {file} --plot {pasted(f'{stem}.png')}{how}"]
    if fit is not None and "--subject" in fit.fault:
        return [f"besman look {file} --subject {pasted(look.subjects[0])}{how}"]
    unnamed = len(look.recording.names) - look.n_named
    commands = []
    if unnamed:
        asked = f" --markers {pasted(look.asked)}" if look.asked else ""
        commands.append(f"besman annotate {file}{asked}{how}")
    if (look.n_named or not unnamed) and not look.asked:
        target = pasted(f"{stem}_markers.yaml")
        commands.append(f"besman markers new {file} --out {target}{how}")
    return commands


def _use_set(look: Look, fit: SetFit, file: str, how: str) -> list[str]:
    """Return commands that take the markers of a set that is complete."""
    name = pasted(look.asked) if look.asked else fit.marker_set.name
    label = _choose_label(look)
    recipe, usual = "ur5_reach", "right_arm"
    if label == _THROW_LABEL and "stick" in fit.found:
        recipe = "ur5_stick_throw"
    elif _is_thrown(look, fit) and not _has_segments(look.path):
        recipe, usual, label = "ur5_free_throw", "spl", _REACH_LABEL
    settings = f" --set label.markers={name}" if name != usual else ""
    if look.needed_gap_s:
        longest = f"{look.needed_gap_s + 0.05:.1f}"
        settings += f" --set label.longest_gap_s={longest}"
    markers = f" --markers {name}" if name != "right_arm" else ""
    if recipe == "ur5_reach" and label != _REACH_LABEL:
        settings += f" --set select.label={shlex.quote(label)}"
    run = f"{recipe} --set recordings={file}{settings}{how}"
    # A run learns to name blocks from some that a person has named; a throw is told without.
    told = recipe == "ur5_free_throw" or _has_segments(look.path)
    annotate = [] if told else [f"besman annotate {file}{markers}{how}"]
    # The command has no setting for longer gaps.
    segments = look.needed_gap_s <= LONGEST_GAP_S
    return [
        *([f"besman segment {file}{markers}{how}"] if segments else []),
        *annotate,
        f"besman check {run}",
        f"besman run {run}",
    ]


def _is_thrown(look: Look, fit: SetFit) -> bool:
    """Tell whether the recording has a ball that flies."""
    ball = fit.found.get(_BALL)
    return ball is not None and any(
        one["name"] == ball and one["greatest_speed_m_s"] > _FLIES_M_S for one in look.trajectories
    )


def _choose_label(look: Look) -> str:
    """Return the name of the blocks to go on with: that of a recipe, else the most frequent."""
    folder = look.path if look.path.is_dir() else look.path.parent
    # A folder of one frame a file is a recording itself.
    path = find_segments(look.path) or find_segments(folder / look.recording.source)
    with warnings.catch_warnings():
        # Whoever uses the segments is warned of what is odd about them; here they give a hint.
        warnings.simplefilter("ignore", RecordingWarning)
        labels = [] if path is None else list(read_segments(path, look.recording).labels)
    if _THROW_LABEL in labels:
        return _THROW_LABEL
    if _REACH_LABEL in labels or not set(labels) - _AT_REST:
        return _REACH_LABEL
    return max(sorted(set(labels) - _AT_REST), key=labels.count)


def _has_segments(path: Path) -> bool:
    """Tell whether a file with segments is beside a recording, or beside one of a folder."""
    within = path.is_dir() and any(path.glob(f"*{SEGMENTS_SUFFIX}"))
    return within or find_segments(path) is not None


def find_next_of_all(
    paths: list[Path], found: list[Look | tuple[Path, str]], options: list[str]
) -> list[str]:
    """Return commands that go on from several recordings, if all have the markers of one set."""
    looks = [one for one in found if isinstance(one, Look)]
    names = {one.best.marker_set.name for one in looks if one.best and one.best.is_complete}
    n_complete = sum(one.best is not None and one.best.is_complete for one in looks)
    if len(paths) != 1 or len(names) != 1 or n_complete < len(found):
        return []
    slowest = max(looks, key=lambda one: one.needed_gap_s)
    whole = replace(slowest, path=paths[0])
    return find_next(whole, options)


def look_table(found: list[Look | tuple[Path, str]]) -> Table:
    """Return a table, one row a recording; one that cannot be read is a row with its reason."""
    from rich.table import Table

    table = Table(box=None)
    paths = [one[0] if isinstance(one, tuple) else one.path for one in found]
    longest = max((len(path.name) for path in paths), default=0)
    # The name is what a user goes on with: it is never cut.
    table.add_column("recording", min_width=min(longest, _WIDEST_NAME), overflow="fold")
    for title in ("format", "Hz", "s", "up", "names", "seen"):
        table.add_column(title)
    # Which set fits is what a user goes on with, too.
    table.add_column("set", overflow="fold")
    for look in found:
        if isinstance(look, tuple):
            table.add_row(look[0].name, "not read", "", "", "", "", "", look[1])
            continue
        origin, recording = look.origin, look.recording
        shares = [one["seen_share"] for one in look.trajectories]
        seen = sum(shares) / len(shares) if shares else 0.0
        table.add_row(
            look.path.name,
            origin.format,
            f"{recording.rate_hz:g}",
            f"{look.duration_s:.4g}",
            f"{origin.up} {origin.units or 'm'}",
            f"{look.n_named}/{len(recording.names)}",
            f"{100 * seen:.0f}%",
            _short_fit(look),
        )
    return table


def name_others(others: list[Path]) -> str:
    """Say which files of a folder are no recordings."""
    shown = ", ".join(one.name for one in others[:_MOST_OTHERS])
    more = f" and {len(others) - _MOST_OTHERS} more" if len(others) > _MOST_OTHERS else ""
    are = "file that is no recording" if len(others) == 1 else "files that are no recordings"
    return f"besides {len(others)} {are}: {shown}{more}"


def row_of(path: Path, reason: str) -> dict[str, Any]:
    """Return a recording that cannot be read, for JSON."""
    return {"recording": str(path), "error": reason}


def _names(look: Look) -> str:
    """Say which names there are."""
    names = [name for name in look.recording.names if name]
    unnamed = len(look.recording.names) - len(names)
    if not names:
        return f"none: {unnamed} trajectories without a name"
    said = f"{len(names)}: {', '.join(names[:_MOST_NAMES])}"
    if len(names) > _MOST_NAMES:
        said += f" and {len(names) - _MOST_NAMES} more"
    if unnamed:
        said += f"; {unnamed} trajectories without a name"
    if look.subjects:
        said += f"; of {', '.join(look.subjects[:4])}"
    if look.recording.orientations is not None:
        said += "; with orientations"
    return said


def _gaps(look: Look) -> list[str]:
    """Say where something is not seen, the worst first."""
    broken = [one for one in look.trajectories if one["gaps"]]
    if not broken:
        return ["  gaps        none"]
    whole = len(look.trajectories) - len(broken)
    broken.sort(key=lambda one: one["seen_share"])
    lines = [f"  gaps        {len(broken)} of {len(look.trajectories)} have some, {whole} none"]
    if not look.n_named:
        shares = sorted(one["seen_share"] for one in look.trajectories)
        middle = 100 * shares[len(shares) // 2]
        lines[0] += f"; a trajectory is seen {middle:.0f}% of the time (median)"
        return lines
    for one in broken[:_MOST_GAPS]:
        count = "1 gap" if one["gaps"] == 1 else f"{one['gaps']} gaps"
        lines.append(
            f"              {one['name'] or 'unnamed'}: seen {100 * one['seen_share']:.1f}%, "
            f"{count}, the longest {one['longest_gap_s']:.3g} s"
        )
    if len(broken) > _MOST_GAPS:
        lines.append(f"              and {len(broken) - _MOST_GAPS} more: --json, --plot")
    return lines


def _movement(look: Look) -> str:
    """Say what moves most, and what stands still."""
    seen = [one for one in look.trajectories if one["seen_share"] > 0]
    moving = [one for one in seen if one["span_m"] > STILL_M]
    if not moving:
        return f"nothing moves by more than {100 * STILL_M:g} cm"
    still = len(seen) - len(moving)
    rest = f"; {still} of {len(seen)} stand still" if still else ""
    if not look.n_named:
        fastest = max(one["greatest_speed_m_s"] for one in moving)
        return f"{len(moving)} move, at most {fastest:.2g} m/s{rest}"
    moving.sort(key=lambda one: one["path_m"], reverse=True)
    said = [
        f"{one['name'] or 'unnamed'} {one['path_m']:.1f} m "
        f"(up to {one['greatest_speed_m_s']:.1f} m/s)"
        for one in moving[:_MOST_MOVERS]
    ]
    return f"most by {', '.join(said)}{rest}"


def _landing(look: Look) -> list[str]:
    """Say where the file has a ball come down, and where that is."""
    on_ring = look.origin.on_ring_m
    if on_ring is None:
        return []
    right, away = (100 * one for one in on_ring)
    side = "right" if right >= 0 else "left"
    said = f"{abs(right):.0f} cm to the {side}, {away:.0f} cm beyond a ring's front, by the file; "
    if look.landing_m is None:
        return [f"  landing     {said}no ring of an NBA court is near"]
    place = ", ".join(f"{one:.2f}" for one in look.landing_m)
    return [f"  landing     {said}the ring nearest on an NBA court: at {place} m"]


def _sets(look: Look) -> list[str]:
    """Say which marker set fits, how well and by which names."""
    fit = look.best
    if fit is None:
        why = "no name is known" if look.n_named else "names have to be found first"
        why += "; a run needs back, shoulder, elbow and hand of a person"
        return [f"  marker set  none: {why}"]
    n_found, n_all = len(fit.found), len(fit.marker_set.markers)
    lines = [f"  marker set  {fit.marker_set.name}: {n_found} of its {n_all} markers"]
    if fit.is_complete:
        lines[0] += ", all that it requires"
    else:
        why = "does not fit; " if look.asked else "none fits; nearest "
        lines[0] = lines[0].replace("set  ", f"set  {why}")
        lines.append(f"              {_why_not(fit)}")
    shown = list(fit.aliases.items())
    if shown:
        pairs = ", ".join(f"{marker} = {name}" for marker, name in shown[:_MOST_NAMES])
        more = len(shown) - _MOST_NAMES
        lines.append(f"              {pairs}" + (f" and {more} more" if more > 0 else ""))
    if look.fault and fit.is_complete:
        where = f"; say it in {look.asked}" if look.asked.endswith(".yaml") else ""
        lines.append(f"              but {look.fault}{where}")
    frames = fit.marker_set.frames
    if frames is not None and fit.is_complete:
        lines += [f"              assumed: {one}" for one in frames.find_assumptions(fit.found)]
    others = [one.marker_set.name for one in look.fits[1:] if one.is_complete]
    if others and fit.is_complete:
        lines.append(f"              {', '.join(others)} would fit too")
    return lines


def _why_not(fit: SetFit) -> str:
    """Say what keeps a set from fitting."""
    if fit.fault:
        return fit.fault
    more = len(fit.missing) - _MOST_NAMES
    shown = ", ".join(fit.missing[:_MOST_NAMES])
    return f"not there: {shown}" + (f" and {more} more" if more > 0 else "")


def _short_fit(look: Look) -> str:
    """Say in a cell which set fits."""
    fit = look.best
    if fit is None:
        return "none"
    count = f"{len(fit.found)}/{len(fit.marker_set.markers)}"
    if not fit.is_complete:
        return f"none ({fit.marker_set.name} {count})"
    return f"{fit.marker_set.name} {count}" + (f", but {look.fault}" if look.fault else "")
