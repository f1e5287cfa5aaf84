"""Commands about live streams: follow --live, mirror, and play, which serves a recording as one."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from besman.cli.terminal import complain, say
from besman.exceptions import ConfigError, FileError, StoppedError, one_of

if TYPE_CHECKING:
    from besman.following.live import LiveFollower
    from besman.following.mirror import Mirror
    from besman.following.plans import FollowPlan
    from besman.live.capture import WholeLines
    from besman.live.lsl_events import LslEvents
    from besman.web.loopback import LoopbackServer
    from besman.web.push import Broadcast

_SYSTEMS = ("qtm", "lsl", "natnet", "mcap")
# Too many; and an address that is for this machine alone.
_NO_EVENTS = ("joints", "page")

Lsl = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Send what changes as a marker stream of LSL, too."),
]
ToNetwork = Annotated[
    bool, typer.Option("--to-network", help="Let --lsl listen at all addresses, as it must.")
]

SOURCE = typer.Option(
    metavar="SOURCE",
    help="file://PATH?pace=1, lsl:NAME, qtm:// or natnet://HOST[:PORT], bag:FOLDER, mcap:FILE.",
)
"""What is followed live."""

Record = Annotated[
    Path | None,
    typer.Option(help="Record the live stream, NAME.tsv; what is printed as NAME.jsonl."),
]
Page = Annotated[
    bool, typer.Option("--page", help="Show it in the browser: its address is the first line.")
]
PagePort = Annotated[
    int | None, typer.Option(min=1, max=65535, help="Of the page; a free one if not given.")
]


def play(
    recording: Annotated[Path, typer.Argument(help="A recording.")],
    system: Annotated[
        str, typer.Option("--as", metavar="qtm|lsl|natnet|mcap", help="Which system it plays.")
    ],
    pace: Annotated[float, typer.Option(help="Seconds of it in a second.")] = 1.0,
    port: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, help="Of qtm, natnet; 0: any that is free; its own if none."
        ),
    ] = None,
    name: Annotated[str, typer.Option(help="Of the stream of lsl.")] = "besman",
    out: Annotated[
        Path | None, typer.Option(help="The file that mcap writes while it plays.")
    ] = None,
    lose: Annotated[float, typer.Option(help="Share of the frames that get lost.")] = 0.0,
    late: Annotated[
        float, typer.Option(help="Seconds by which one frame in twenty is late at most.")
    ] = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Of what is lost and late.")] = 0,
    unnamed: Annotated[
        bool, typer.Option("--unnamed", help="Without the names of its markers.")
    ] = False,
    to_network: Annotated[
        bool, typer.Option("--to-network", help="Let lsl listen at all addresses, as it must.")
    ] = False,
) -> None:
    """Serve a recording over loopback as a capture system would, to who connects first.

    Of mcap a file is written, as long as it plays.
    """
    from besman.io.recordings.formats import read_recording
    from besman.live.natnet_source import PORT as NATNET_PORT
    from besman.live.play_lsl import play_as_lsl
    from besman.live.play_mcap import play_as_mcap
    from besman.live.play_natnet import play_as_natnet
    from besman.live.play_qtm import Delays, play_as_qtm
    from besman.live.qtm_source import PORT as QTM_PORT

    if system not in _SYSTEMS:
        raise ConfigError(f"--as: got {system!r:.60}; expected {one_of(_SYSTEMS)}")
    if system == "lsl" and not to_network:
        raise ConfigError(
            "--as lsl: liblsl listens at all addresses of this machine, and cannot be told to stay "
            "on loopback; expected --to-network, which permits it, or --as qtm"
        )
    if (system == "mcap") != (out is not None):
        raise ConfigError("--out: is the file of --as mcap; expected both, or neither")
    found, delays = read_recording(recording), Delays(pace, lose, late, seed)
    if unnamed:
        found = replace(found, names=(None,) * len(found.names))
    if system == "qtm":
        play_as_qtm(found, delays, QTM_PORT if port is None else port, say)
    elif out is not None:
        play_as_mcap(found, out, delays, say)
    elif system == "natnet":
        play_as_natnet(found, delays, NATNET_PORT if port is None else port, say)
    else:
        play_as_lsl(found, name, delays, say)


def follow_live(
    address: str,
    plan: "FollowPlan",
    horizon_blocks: int | None,
    steady_s: float,
    record: Path | None,
    json_file: Path | None,
    events: "LslEvents | None" = None,
    page: bool = False,
    port: int | None = None,
) -> None:
    """Follow a source; print and record lines of JSON. Ctrl-C ends it in order.

    With `page` it is shown in the browser, too.
    """
    from besman.following.live import LiveFollower
    from besman.io.atomic_files import write_json
    from besman.live.addresses import find_source

    follower = LiveFollower(find_source(address), plan, horizon_blocks, steady_s)
    teller = _Teller(keeps=json_file is not None, events=events)
    if page:
        from besman.view.follow_live import open_follow_page

        _show_page(open_follow_page(follower, teller.publish(), port), follower, teller, record)
    else:
        _tell_all(follower, teller, record)
    if json_file is not None:
        write_json(json_file, teller.told)
    teller.close()


def mirror(
    live: Annotated[str, SOURCE],
    run: Annotated[
        Path | None, typer.Option(help="A finished run: its robot, and where it placed the hand.")
    ] = None,
    robot: Annotated[
        str | None, typer.Option(help="In place of --run; the first seconds tell the hand's place.")
    ] = None,
    tool: Annotated[str | None, typer.Option(help="Of --robot; default the robot's own.")] = None,
    markers: Annotated[
        str | None, typer.Option(help="Marker set; default the run's, or right_arm.")
    ] = None,
    learn: Annotated[
        float | None,
        typer.Option(
            help="With --robot: seconds of the hand that its place is learnt from, 1 to 600; "
            "default 10."
        ),
    ] = None,
    record: Record = None,
    page: Page = False,
    port: PagePort = None,
    lsl: Lsl = None,
    to_network: ToNetwork = False,
) -> None:
    """Have a simulated arm move as the hand of a person does, within its limits; lines of JSON."""
    from besman.following.hand_placement import MirrorPlan, mirror_as_in_run
    from besman.following.mirror import Mirror
    from besman.live.addresses import find_source
    from besman.live.file_source import FileSource
    from besman.robot.model import load_robot

    if (run is None) == (robot is None):
        raise ConfigError("besman mirror: expected either --run RUN or --robot NAME")
    _refuse_useless(run is not None, tool, learn)
    check_port(page, port)
    source = find_source(live)
    if run is not None:
        plan = mirror_as_in_run(run, markers)
    else:
        plan = MirrorPlan(load_robot(str(robot), tool), markers or "right_arm")
    by_frames = isinstance(source, FileSource) and not source.is_paced
    teller = _Teller(keeps=False, events=announce_events(lsl, to_network))
    twin = Mirror(source, plan, 10.0 if learn is None else learn, by_frames)
    if page:
        from besman.view.mirror_live import open_mirror_page

        _show_page(open_mirror_page(twin, teller.publish(), port), twin, teller, record)
    else:
        _tell_all(twin, teller, record)
    teller.close()


def check_port(page: bool, port: int | None) -> None:
    """Refuse a port of nothing."""
    if port is not None and not page:
        raise ConfigError("--port: is of --page; expected both, or neither")


def _refuse_useless(has_run: bool, tool: str | None, learn: float | None) -> None:
    """Refuse what a run says already."""
    if has_run and tool is not None:
        raise ConfigError("--tool: is of --robot; with --run the tool is the run's")
    if has_run and learn is not None:
        raise ConfigError("--learn: is of --robot; with --run the hand's place is the run's")


def _show_page(
    server: "LoopbackServer",
    follower: "LiveFollower | Mirror",
    teller: "_Teller",
    record: Path | None,
) -> None:
    """Serve a page of it to this machine while the stream comes."""
    teller.tell({"kind": "page", "url": server.url})
    server.start()
    try:
        _tell_all(follower, teller, record)
    finally:
        if teller.news is not None:
            teller.news.end()
        server.stop()


def _tell_all(follower: "LiveFollower | Mirror", teller: "_Teller", record: Path | None) -> None:
    """Tell what becomes known of a source until it ends, or Ctrl-C ends it in order."""
    from besman.live.capture import CaptureFile, WholeLines

    def capture(names: Sequence[str | None], rate_hz: float) -> CaptureFile:
        assert record is not None
        made = CaptureFile(record, names, rate_hz)
        teller.lines = WholeLines(record.with_suffix(".jsonl"))
        return made

    found = follower.open(capture if record is not None else None)
    begin = {"kind": "stream", "source": found.source, "rate_hz": found.rate_hz}
    teller.tell(begin | {"markers": list(found.names)})
    try:
        for one in follower.run():
            teller.tell(one)
    except StoppedError as error:
        # What was known until then is said, and recorded whole.
        for one in follower.end_now():
            teller.tell(one)
        complain("", str(error))


def announce_events(name: str | None, to_network: bool) -> "LslEvents | None":
    """Return the marker stream of LSL that is asked for.

    Raises
    ------
    ConfigError, WebError
        If it was not permitted, or cannot be announced; if a permission is of nothing.
    """
    if name is None and to_network:
        raise ConfigError("--to-network: is of --lsl NAME; expected both, or neither")
    if name is None:
        return None
    if not to_network:
        raise ConfigError(
            "--lsl: liblsl listens at all addresses of this machine, and cannot be told to stay on "
            "loopback; expected --to-network, which permits it"
        )
    from besman.live.lsl_events import LslEvents

    return LslEvents(name)


class _Teller:
    """Prints lines of JSON, and records them; where that fails they are printed all the same."""

    def __init__(self, keeps: bool, events: "LslEvents | None" = None) -> None:
        self._keeps, self._events = keeps, events
        self.lines: WholeLines | None = None
        self.told: list[dict[str, Any]] = []
        self.news: Broadcast | None = None
        self._failed: FileError | None = None

    def publish(self) -> "Broadcast":
        """Return what is told from now on, for the page."""
        from besman.web.push import Broadcast

        self.news = Broadcast()
        return self.news

    def tell(self, one: dict[str, Any]) -> None:
        """Print what has become known as a line, send it on and keep it, as was asked for."""
        import json

        text = json.dumps(_finite(one)) + "\n"
        sys.stdout.write(text)
        sys.stdout.flush()
        if self._events is not None and one.get("kind") not in _NO_EVENTS:
            self._events.send(text.rstrip())
        # A page sees where the arm is thirty times a second.
        if self.news is not None and one.get("kind") != "joints":
            self.news.send(text)
        if self._keeps:
            self.told.append(one)
        if self.lines is None:
            return
        try:
            self.lines.append(text)
        except FileError as error:
            self._failed, lines, self.lines = error, self.lines, None
            lines.close()

    def close(self) -> None:
        """End; raise what went wrong on the way."""
        if self.lines is not None:
            self.lines.close()
        if self._failed is not None:
            raise self._failed


def _finite(one: dict[str, Any]) -> dict[str, Any]:
    """Return what JSON can say: what is not finite becomes null."""
    inf = float("inf")
    return {
        key: None if isinstance(value, float) and not abs(value) < inf else value
        for key, value in one.items()
    }
