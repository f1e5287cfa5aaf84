"""Commands about recordings, without a pipeline: train, segment, follow, label-markers, synth."""

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from besman.cli.live import (
    SOURCE,
    Lsl,
    Page,
    PagePort,
    Record,
    ToNetwork,
    announce_events,
    check_port,
    follow_live,
)
from besman.cli.options import Json, Recordings, target_file, target_folder
from besman.cli.terminal import say
from besman.exceptions import ConfigError, one_of
from besman.io.recordings.formats import WRITTEN_SUFFIXES
from besman.stages.segment.kinds import SEGMENTATION_NAMES
from besman.synthetic.names import DATASET_NOTES

_DATASETS = ", ".join(f"{name} ({note})" if note else name for name, note in DATASET_NOTES.items())

LearnFrom = Annotated[
    Path | None,
    typer.Option(help="A recording with names, to learn the distances of markers from."),
]


def train(
    segments: Annotated[
        list[Path],
        typer.Argument(help="Recordings with segments files beside them, or those, or folders."),
    ],
    out: Annotated[Path, typer.Option(help="Model to write: NAME.npz and NAME.json.")],
    markers: Annotated[str, typer.Option(help="Marker set.")] = "right_arm",
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="KEY=VALUE of recognize, e.g. method=hmm."),
    ] = None,
    learn_from: LearnFrom = None,
) -> None:
    """Learn to name segments; a pipeline uses the model with recognize: {model: PATH}."""
    from besman.cli.terminal import open_terminal
    from besman.pipeline.known_classes import list_counts
    from besman.stages.recognize.model_files import load_model
    from besman.standalone.train_files import train_files

    written = train_files(segments, out, markers, tuple(settings or ()), learn_from)
    counts = list_counts(Counter(load_model(written[0]).labels))
    lines = [f"learnt {counts}", *(f"wrote {path}" for path in written)]
    open_terminal().print("\n".join(lines), soft_wrap=True)


def segment(
    recordings: Recordings,
    method: Annotated[
        str, typer.Option(help=f"{one_of(SEGMENTATION_NAMES)}.")
    ] = SEGMENTATION_NAMES[0],
    markers: Annotated[str, typer.Option(help="Marker set.")] = "right_arm",
    rate_hz: Annotated[
        float | None, typer.Option(help="Sampling rate of a method that has one.")
    ] = None,
    learn_from: LearnFrom = None,
    json_file: Json = None,
) -> None:
    """Find the borders of the building blocks in recordings."""
    from besman.cli.terminal import open_terminal
    from besman.io.atomic_files import write_json
    from besman.standalone.segment_files import segment_files, segment_table

    found = segment_files(recordings, method, markers, rate_hz, learn_from)
    open_terminal().print(segment_table(found))
    if json_file is not None:
        write_json(json_file, found)


def follow(
    recording: Annotated[
        Path | None, typer.Argument(help="A recording, replayed as a stream.")
    ] = None,
    live: Annotated[str | None, SOURCE] = None,
    record: Record = None,
    run: Annotated[Path | None, typer.Option(help="A run, whose trained models are used.")] = None,
    models: Annotated[
        list[Path] | None,
        typer.Option("--model", help="A model of besman train; one for each arm."),
    ] = None,
    markers: Annotated[
        str | None, typer.Option(help="Marker set; default the run's, or right_arm.")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="1 for real time; default as fast as can be.")
    ] = None,
    horizon: Annotated[
        int, typer.Option(min=0, help="Blocks after which an action is final; 0: at the end.")
    ] = 20,
    steady: Annotated[
        float, typer.Option(min=0, help="Seconds that a border must hold to be shown.")
    ] = 0.2,
    calibration: Annotated[
        float | None,
        typer.Option(help="Scale by the first seconds; default by the run's recordings, or 10."),
    ] = None,
    page: Page = False,
    port: PagePort = None,
    lsl: Lsl = None,
    to_network: ToNetwork = False,
    json_file: Json = None,
) -> None:
    """Keep blocks and actions current sample by sample; print what changes and what comes next.

    Of a live source as lines of JSON.
    """
    from besman.following.files import Replay, describe_change, describe_forecast
    from besman.following.foreseeing import BlockForecast
    from besman.following.plans import make_plan
    from besman.io.atomic_files import write_json

    _check_followed(
        recording, live, {"--record": record, "--lsl": lsl, "--page": "" if page else None}
    )
    check_port(page, port)
    plan = make_plan(run, models or [], markers, calibration)
    if recording is None:
        events = announce_events(lsl, to_network)
        options = horizon or None, steady, record, json_file, events, page, port
        follow_live(str(live), plan, *options)
        return
    replay = Replay(recording, plan, speed, horizon or None, steady)
    rate_hz = replay.recording.rate_hz
    for at, news in replay.run():
        if isinstance(news, BlockForecast):
            say(describe_forecast(news, rate_hz))
        else:
            say(describe_change(at, news, rate_hz))
    say(replay.summary())
    if json_file is not None:
        write_json(json_file, replay.content())


def _check_followed(
    recording: Path | None, live: str | None, of_live: dict[str, Path | str | None]
) -> None:
    """Refuse two things to follow or none, and options of a stream without one."""
    if (recording is None) == (live is None):
        raise ConfigError("besman follow: expected either a recording or --live SOURCE")
    for option, given in of_live.items():
        if live is None and given is not None:
            raise ConfigError(f"{option}: is of a live stream; expected --live SOURCE with it")


def label_markers(
    recording: Annotated[Path, typer.Argument(help="A recording, wholly or partly unnamed.")],
    out: Annotated[Path, typer.Option(help=f"File to write, {one_of(WRITTEN_SUFFIXES)}.")],
    markers: Annotated[str, typer.Option(help="Marker set.")] = "right_arm",
    learn_from: LearnFrom = None,
    ignore_names: Annotated[
        bool, typer.Option("--ignore-names", help="Name all anew, whatever they are called.")
    ] = False,
    fill: Annotated[bool, typer.Option("--fill", help="Fill short gaps.")] = False,
    figure: Annotated[
        Path | None,
        typer.Option(help="Draw a time line, .png or .svg.", callback=target_file),
    ] = None,
    json_file: Json = None,
) -> None:
    """Name what has no name in a recording; what is not sure stays unnamed."""
    from besman.cli.terminal import open_terminal
    from besman.io.atomic_files import write_json
    from besman.standalone.label_file import (
        check_figure,
        draw_names,
        label_file,
        summarise,
        summary_tables,
    )

    if figure is not None:
        check_figure(figure)
    names, named = label_file(recording, markers, out, learn_from, fill, ignore_names)
    summary = summarise(names, named)
    console = open_terminal()
    for table in summary_tables(summary):
        console.print(table)
    console.print(f"wrote {out}", soft_wrap=True)
    if json_file is not None:
        write_json(json_file, summary)
    if figure is not None:
        draw_names(named, figure)


def synth(
    dataset: Annotated[str, typer.Argument(help=f"One of {_DATASETS}.")],
    out: Annotated[
        Path,
        typer.Option(
            help="Folder to write to; no file in it is overwritten.", callback=target_folder
        ),
    ],
    subjects: Annotated[
        int | None, typer.Option(min=1, help="How many; as in the thesis by default.")
    ] = None,
    repetitions: Annotated[
        int | None, typer.Option(min=1, help="Of each subject; as in the thesis by default.")
    ] = None,
    rate_hz: Annotated[
        float | None, typer.Option(min=60, max=500, help="Frames per second; the dataset's if not.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of people and their movements.")] = 0,
    unlabelled: Annotated[
        bool, typer.Option("--unlabelled", help="Unnamed trajectories with gaps and ghosts.")
    ] = False,
) -> None:
    """Write synthetic captures with their truth: simulated people before simulated cameras."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.synthetic.cameras import Room
    from besman.synthetic.datasets import write_synthetic

    room = Room() if unlabelled else None
    with stage_display() as display:
        progress, end = display(f"synth {dataset}")
        paths = write_synthetic(dataset, out, subjects, repetitions, rate_hz, seed, room, progress)
        end(True)
    for path in paths:
        open_terminal().print(f"wrote {path} (synthetic)", soft_wrap=True)
