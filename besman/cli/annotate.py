"""The command ``besman annotate``. Everything heavy is imported when it runs."""

from pathlib import Path
from typing import Annotated

import typer

from besman.cli.terminal import say


def annotate(
    recordings: Annotated[list[Path], typer.Argument(help="Recordings, or folders of them.")],
    segments: Annotated[
        Path | None,
        typer.Option(help="Segments file; default STEM_manually_segmented.json beside each."),
    ] = None,
    labels: Annotated[
        str | None, typer.Option(help="Labels to offer, e.g. throw,strike_out; more on the page.")
    ] = None,
    run: Annotated[
        Path | None, typer.Option(help="A run, whose trained model names proposals.")
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="A model of besman train, which names proposals.")
    ] = None,
    markers: Annotated[
        str | None, typer.Option(help="Marker set; default the first that fits.")
    ] = None,
    learn_from: Annotated[
        Path | None,
        typer.Option(help="A recording with names, to name unnamed trajectories after."),
    ] = None,
    port: Annotated[
        int | None, typer.Option(min=1, max=65535, help="Default any free one.")
    ] = None,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address only.")
    ] = False,
) -> None:
    """Give segments and labels by hand, on a page in the browser."""
    from besman.annotate.server import make_server
    from besman.annotate.session import Session
    from besman.annotate.sources import load_models, split_labels

    session = Session(
        recordings, segments, split_labels(labels), markers, load_models(run, model), learn_from
    )
    server = make_server(session, port)
    for take in session.takes:
        say(f"{take.path.name}: segments in {take.document.path}")
        if take.naming is not None:
            n = len(take.naming.fragments)
            say(f"{take.path.name}: {n} fragments without a name; {take.named_file.path}")
    say(f"open {server.url}")
    say("stop with Ctrl+C")
    server.serve(browser=not no_browser)
