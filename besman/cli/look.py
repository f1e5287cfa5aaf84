"""Commands that say what is in a recording: look, markers new."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from besman.cli.options import Json, Recordings, target_file
from besman.cli.terminal import complain, say
from besman.exceptions import RecordingError

if TYPE_CHECKING:
    from besman.standalone.look_files import Look


def look(
    recordings: Recordings,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw one recording, .png or .svg.", callback=target_file),
    ] = None,
    markers: Annotated[
        str | None, typer.Option(help="Marker set to hold against it; default all there are.")
    ] = None,
    json_file: Json = None,
) -> None:
    """Say what is in a recording, which marker set fits and how to go on; of several a table."""
    from besman.io.atomic_files import write_json
    from besman.io.recordings.format import reading_options
    from besman.standalone.look_files import (
        Look,
        content_of,
        gather,
        look_at_all,
        put_alike_together,
    )
    from besman.standalone.look_text import (
        find_next,
        find_next_of_all,
        look_table,
        name_others,
        row_of,
    )

    options = reading_options()
    gathered = gather(recordings)
    is_alone = len(recordings) == 1 and not gathered.unread
    if is_alone and gathered.files in (recordings, [recordings[0].resolve()]):
        _look_at_one(gathered.files[0], plot, markers, json_file)
        if gathered.others:
            say(name_others(gathered.others))
        return
    if plot is not None:
        raise RecordingError("--plot: several recordings; expected one")
    looked = look_at_all(gathered.files, markers)
    found = put_alike_together([*looked, *gathered.unread])
    from besman.cli.terminal import open_terminal

    open_terminal().print(look_table(found))
    if gathered.others:
        say(name_others(gathered.others))
    for command in find_next_of_all(recordings, looked, options):
        say(command)
    if json_file is not None:
        rows = [
            content_of(one, find_next(one, options)) if isinstance(one, Look) else row_of(*one)
            for one in found
        ]
        write_json(json_file, rows)
    _complain_of(found)


def _complain_of(found: "list[Look | tuple[Path, str]]") -> None:
    """Say how many recordings had warnings, or could not be read."""
    looks = [one for one in found if not isinstance(one, tuple)]
    n_warned, n_unread = sum(bool(one.warnings) for one in looks), len(found) - len(looks)
    if n_warned:
        complain("", f"{n_warned} of {len(found)} with warnings: besman look FILE shows them")
    if 0 < n_unread < len(found):
        complain("", f"{n_unread} of {len(found)} cannot be read: besman look FILE says why")
    if n_unread == len(found):
        raise RecordingError(f"none of {len(found)} recordings can be read")


def _look_at_one(
    path: Path, plot: Path | None, markers: str | None, json_file: Path | None
) -> None:
    """Say what is in one recording."""
    from besman.io.atomic_files import write_json
    from besman.io.recordings.format import reading_options
    from besman.standalone.look_files import content_of, look_at
    from besman.standalone.look_text import describe_look, find_next

    one = look_at(path, markers)
    commands = find_next(one, reading_options())
    for line in describe_look(one, commands):
        say(line)
    if plot is not None:
        from besman.report.recording_figure import draw_sticks_and_gaps

        names = () if one.best is None else tuple(one.best.found.values())
        draw_sticks_and_gaps(one.recording, names, plot)
        say(f"wrote {plot}")
    if json_file is not None:
        write_json(json_file, content_of(one, commands))


markers_app = typer.Typer(no_args_is_help=True, help="Marker sets: propose one from a recording.")


@markers_app.callback()
def _markers() -> None:
    """Marker sets: propose one from a recording."""


@markers_app.command("new")
def new_markers(
    recording: Annotated[Path, typer.Argument(help="A recording, with names or without.")],
    out: Annotated[Path, typer.Option(help="File to write, .yaml.")],
) -> None:
    """Propose a marker set from a recording, to be mended by hand."""
    from besman.standalone.propose_set import write_marker_set

    written = write_marker_set(recording, out)
    n_clusters = len(written.clusters)
    say(
        f"{len(written.markers)} markers, {len(written.required)} required, "
        f"{n_clusters} rigid cluster{'' if n_clusters == 1 else 's'}"
    )
    if not written.roles:
        say("shoulder, elbow and hand are not told by names: say in the file which they are")
    say(f"wrote {out}; it is used with --markers {out}")
