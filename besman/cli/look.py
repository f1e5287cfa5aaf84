"""Commands that say what is in a recording: look, markers new."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from besman.cli.options import Json, Recordings, target_file
from besman.cli.terminal import complain, say
from besman.exceptions import RecordingError


def look(
    recordings: Recordings,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw one recording, .png or .svg.", callback=target_file),
    ] = None,
    json_file: Json = None,
) -> None:
    """Say what is in a recording, which marker set fits and how to go on; of several a table."""
    from besman.io.atomic_files import write_json
    from besman.io.recordings.formats import find_recordings, reading_options
    from besman.standalone.look_files import Look, content_of, look_at, look_at_all
    from besman.standalone.look_text import describe_look, find_next, look_table, row_of

    options = reading_options()
    if len(recordings) == 1 and not recordings[0].is_dir():
        one = look_at(recordings[0])
        commands = find_next(one, options)
        for line in describe_look(one, commands):
            say(line)
        if plot is not None:
            from besman.report.recording_figure import draw_recording

            best = one.best
            draw_recording(one.recording, None if best is None else best.found, plot)
            say(f"wrote {plot}")
        if json_file is not None:
            write_json(json_file, content_of(one, commands))
        return
    if plot is not None:
        raise RecordingError("--plot: several recordings; expected one")
    found = look_at_all(find_recordings(recordings))
    from besman.cli.terminal import open_terminal

    open_terminal().print(look_table(found))
    if json_file is not None:
        rows = [
            content_of(one, find_next(one, options)) if isinstance(one, Look) else row_of(*one)
            for one in found
        ]
        write_json(json_file, rows)
    n_warned = sum(isinstance(one, Look) and bool(one.warnings) for one in found)
    if n_warned:
        complain("", f"{n_warned} of {len(found)} with warnings: besman look FILE shows them")
    if not any(isinstance(one, Look) for one in found):
        raise RecordingError(f"none of {len(found)} recordings can be read")
