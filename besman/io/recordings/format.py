"""What a format of recordings is: how its files are told from others, read and written.

Nothing here or in the table of formats imports a reader: that is done when a file is read.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol, TypeVar, get_args

from besman.exceptions import RecordingError, one_of
from besman.foreign.numbers import parse_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from besman.records import Axis, Recording

Units = Literal["m", "cm", "mm", "in", "ft"]

Name = TypeVar("Name", bound=str)

# Endings that many other files have too: in a folder their content alone counts.
_SHARED_SUFFIXES = frozenset({".csv", ".json", ".txt"})


def parse_units(text: str | None) -> Units | None:
    """Return units by their name; None for None.

    Raises
    ------
    RecordingError
        If they are none.
    """
    known: tuple[Units, ...] = get_args(Units)
    return _one_of_names(text, known, "--units")


def parse_up(text: str | None) -> Axis | None:
    """Return the axis that points up by its name, such as ``y`` or ``-z``; None for None.

    Raises
    ------
    RecordingError
        If it is none.
    """
    known: tuple[Axis, ...] = ("x", "y", "z", "-x", "-y", "-z")
    return _one_of_names(text, known, "--up")


def parse_rate(text: str | None) -> float | None:
    """Return frames per second by their text; None for None.

    Raises
    ------
    RecordingError
        If it is no rate of a camera.
    """
    if text is None:
        return None
    from besman.records.recordings import RATES_HZ

    slowest, fastest = RATES_HZ
    try:
        rate_hz = parse_number(text)
    except ValueError:
        rate_hz = 0.0
    if not slowest <= rate_hz <= fastest:
        raise RecordingError(f"--rate: got {text!r:.40}; expected {slowest:g} to {fastest:g} Hz")
    return rate_hz


def parse_topics(text: str | None) -> tuple[str, ...] | None:
    """Return names between commas; None for None."""
    if text is None:
        return None
    return tuple(one for part in text.split(",") if (one := part.strip()))


def _one_of_names(text: str | None, known: tuple[Name, ...], option: str) -> Name | None:
    """Return a name out of several."""
    if text is None:
        return None
    wanted = text.strip().lower().removeprefix("+")
    found = next((name for name in known if name == wanted), None)
    if found is None:
        raise RecordingError(f"{option}: got {text!r:.40}; expected {one_of(known)}")
    return found


class Columns(Protocol):
    """Trajectories that are put together when they are written.

    Attributes
    ----------
    names : tuple of (str or None), length K
    """

    @property
    def names(self) -> tuple[str | None, ...]:
        """How they are called."""
        ...

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Return some of the frames, shape (stop - start, K, 3), metres; NaN where not seen."""
        ...


@dataclass(frozen=True)
class Format:
    """A format of recordings: one entry of `besman.io.recordings.formats.FORMATS`.

    Functions are named ``module:function``, the module being one of ``besman.io.recordings``.

    Attributes
    ----------
    name : str
        As in messages and tables.
    suffixes : tuple of str
        Usual endings of its files, with the dot, in small letters.
    sniff : callable
        Tells of the first bytes of a file whether it is one; no two formats want the same file.
    reader : str
        Takes a path, and units (of `Units`, or None) if `takes_units`; returns a `Recording` in
        metres and in the file's frame.
    about : str
        Where such files come from, which variants are known, and what a file needs.
    writer : str, optional
        Takes a recording and a path. Only of formats that can hold any recording: trajectories
        without a name, and gaps.
    takes_columns : bool
        Whether the writer takes `Columns` besides, a keyword ``beside``, so that a long recording
        need not be put together.
    companions : str, optional
        Takes a path and returns the further files that a recording is read with.
    takes_units : bool
        Whether a file may leave open what its coordinates are in, or say it wrongly.
    takes_partial : bool
        Whether the reader can take what is there of a file that was cut: a keyword ``partial``.
    has_one_up : bool
        Whether the format itself fixes that z is up, so that nobody need look.
    writes_zeros : bool
        Whether programs write 0, 0, 0 in it for what was not seen.
    turns_from_pose : bool
        Whether bodies are turned from a pose of the file's own, whose axes no marker set knows.
    takes_folders : bool
        Whether its reader takes a folder, too, whose files hold a frame each.
    """

    name: str
    suffixes: tuple[str, ...]
    sniff: Callable[[bytes], bool]
    reader: str
    about: str
    writer: str | None = None
    takes_columns: bool = False
    companions: str | None = None
    takes_units: bool = False
    takes_partial: bool = False
    has_one_up: bool = False
    writes_zeros: bool = False
    turns_from_pose: bool = False
    takes_folders: bool = False

    @property
    def own_suffixes(self) -> tuple[str, ...]:
        """Endings by which a file of a folder is meant to be one, whatever it holds."""
        return tuple(suffix for suffix in self.suffixes if suffix not in _SHARED_SUFFIXES)

    @property
    def endings(self) -> str:
        """The endings for a table, and whether such files are written too."""
        return ", ".join(self.suffixes) + (" (written too)" if self.writer else "")

    def read(self, path: Path, units: Units | None = None, partial: bool = False) -> Recording:
        """Read a file.

        Parameters
        ----------
        path : Path
        units : "m", "cm", "mm" or "in", optional
            What its coordinates are in, whatever it says itself.
        partial : bool
            Take what is there of a file that was cut.
        """
        options: dict[str, Any] = {"units": units} if self.takes_units else {}
        if self.takes_partial:
            options["partial"] = partial
        recording: Recording = _function(self.reader)(path, **options)
        return recording

    def sign(self, recording: Recording) -> Recording:
        """Return a recording of this format that says so."""
        from dataclasses import replace

        from besman.io.recordings.conventions import BY_FORMAT
        from besman.records import Origin

        origin = recording.origin or Origin()
        up_by = origin.up_by or (BY_FORMAT if self.has_one_up else "")
        return replace(recording, origin=replace(origin, format=self.name, up_by=up_by))

    def write(self, recording: Recording, path: Path, beside: Columns | None = None) -> None:
        """Write a file; only of formats that have a `writer`.

        Parameters
        ----------
        recording : Recording
        path : Path
        beside : Columns, optional
            Trajectories of the same frames that follow those of the recording.
        """
        assert self.writer is not None
        options: dict[str, Any] = {}
        if beside is not None and self.takes_columns:
            options["beside"] = beside
        elif beside is not None:
            recording = _join(recording, beside)
        _function(self.writer)(recording, path, **options)

    def find_companions(self, path: Path) -> tuple[Path, ...]:
        """Return the further files that a recording is read with."""
        found = () if self.companions is None else _function(self.companions)(path)
        return tuple(found)


def _join(recording: Recording, beside: Columns) -> Recording:
    """Put further trajectories behind those of a recording."""
    from dataclasses import replace

    import numpy as np

    more = beside.rows(0, len(recording.time))
    positions = np.concatenate([recording.positions, more], axis=1)
    names = (*recording.names, *beside.names)
    return replace(recording, positions=positions, names=names, orientations=None)


def _function(name: str) -> Any:
    """Import a function of this folder by its name, ``module:function``."""
    return resolve_name(f"{__package__}.{name}")


def text_begins(pattern: bytes) -> Callable[[bytes], bool]:
    """Return a test whether a text begins like this, blank lines and marks of encoding aside.

    Parameters
    ----------
    pattern : bytes
        A regular expression. ``.`` stands for line ends too, ``^`` for the start of any line;
        capital and small letters are different.
    """
    expression = re.compile(pattern, re.DOTALL | re.MULTILINE)
    return lambda head: expression.match(_text(head)) is not None


def text_has(pattern: bytes) -> Callable[[bytes], bool]:
    """Return a test whether a text has this anywhere; patterns are those of `text_begins`."""
    expression = re.compile(pattern, re.DOTALL | re.MULTILINE)
    return lambda head: expression.search(_text(head)) is not None


def _text(head: bytes) -> bytes:
    """Return the first bytes of a text without marks of its encoding and blank lines before it."""
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return head[2:].replace(b"\0", b"")
    if b"\r" in head and b"\n" not in head:
        head = head.replace(b"\r", b"\n")
    return head.removeprefix(b"\xef\xbb\xbf").lstrip()


def is_c3d(head: bytes) -> bool:
    """Tell C3D: the number of the first block of parameters, then P."""
    # Text may start with a tab or line end and P, but has no zero bytes.
    return head[1:2] == b"P" and 2 <= head[0] < 32 and (head[0] not in b"\t\n\r" or b"\0" in head)


def is_bag(head: bytes) -> bool:
    """Tell a bag of ROS messages; one in SQLite by its tables."""
    if head.startswith(b"SQLite format 3"):
        return b"CREATE TABLE topics" in head and b"CREATE TABLE messages" in head
    return head.startswith((b"\x89MCAP0\r\n", b"#ROSBAG V"))


_OTHER_TABLES = re.compile(
    rb"(?i)(#[^\n]*\n)*(# *(urdf|frames) *:|time_s *,|\"?(pathfile|format ver))"
)
_NUMBER = rb"(?:-?[0-9][-+.0-9eE]*|NaN|null)"
_POSITION = rb"\[\s*(?:" + _NUMBER + rb"\s*(?:,\s*|(?=\]))){3}"
_NAMED = re.compile(rb'"[^"\n]+"\s*:\s*' + _POSITION)
_LISTED = re.compile(rb'"[^"\n]+"\s*:\s*\[\s*' + _POSITION)
_FRAMED = re.compile(rb'"(frames|tracking|data|keypoints|markers|poses)"\s*:\s*\[\s*\{')
_RATED = re.compile(rb'"(fps|rate_hz|rate|frame_rate|framerate|sampling_rate|sample_rate)"\s*:')
IN_PICTURES = re.compile(rb'"image_id"\s*:|"(images|licenses|annotations)"\s*:\s*\[')
"""What COCO's files hold: points in pictures, of two numbers."""
_LONG = 16_384  # of a file no more is looked at
# Names of people's parts beside numbers, in whatever way a place is written.
_PARTS = re.compile(
    rb"(?i)\"[^\"\n]*(shoulder|elbow|wrist|hip|knee|ankle|nose|eye|ear|hand|foot|head|neck)"
)
_PLACES = re.compile(
    _POSITION + rb'|"(?i:x)"\s*:\s*' + _NUMBER + rb'\s*,\s*"(?i:y)"\s*:\s*' + _NUMBER
    + rb'|"[^"\n]+[_. :][xX]"\s*[:,]|"[xX]"\s*:\s*\[\s*' + _NUMBER
)  # fmt: skip


def is_keypoints(head: bytes) -> bool:
    """Tell keypoints: frames of which each has names of positions, or names with lists of them."""
    text = _text(head)
    if text[:1] not in (b"{", b"[") or IN_PICTURES.search(text):
        return False
    if b'"pose_keypoints_3d"' in text or b'"joints19"' in text:
        return True
    framed = re.match(rb"\[\s*\{", text) or _FRAMED.search(text)
    if framed and len(_NAMED.findall(text)) > 1:
        return True
    if _RATED.search(text) is not None and len(_LISTED.findall(text)) > 1:
        return True
    # One list may be longer than what is looked at.
    n_parts = len({one.lower() for one in _PARTS.findall(text)})
    return n_parts > (len(head) < _LONG) and len(_PLACES.findall(text)) > 1


def is_keypoint_csv(head: bytes) -> bool:
    """Tell keypoints in a table: below comments, and not what another format begins with."""
    from besman.io.recordings.keypoint_columns import is_keypoint_table

    text = _text(head)
    if b"\0" in text or text[:1] in (b"{", b"[", b"<") or _OTHER_TABLES.match(text):
        return False
    return is_keypoint_table(text.decode("utf-8", "replace"))


class Reading(NamedTuple):
    """How `read_recording` reads where its caller does not say.

    Attributes
    ----------
    units, partial, up, rate_hz, subject, topics
        As of `read_recording`.
    """

    units: Units | None = None
    partial: bool = False
    up: Axis | None = None
    rate_hz: float | None = None
    subject: str | None = None
    topics: tuple[str, ...] = ()


_AS_FILES_SAY = Reading()
READING: ContextVar[Reading] = ContextVar("reading", default=_AS_FILES_SAY)
"""What `reading` set, for `besman.io.recordings.formats.read_recording` and for readers."""


@contextmanager
def reading(
    *,
    units: Units | None = None,
    partial: bool | None = None,
    up: Axis | None = None,
    rate_hz: float | None = None,
    subject: str | None = None,
    topics: tuple[str, ...] | None = None,
) -> Iterator[None]:
    """Let `read_recording` read so, within a block of code.

    For whoever reads recordings through other functions, as commands do. What is None stays as it
    was before.

    Parameters
    ----------
    units, partial, up, rate_hz, subject, topics
        As of `read_recording`.
    """
    asked = Reading(units, partial, up, rate_hz, subject, topics)  # type: ignore[arg-type]
    before = READING.get()
    said = {key: value for key, value in asked._asdict().items() if value is not None}
    token = READING.set(before._replace(**said))
    try:
        yield
    finally:
        READING.reset(token)


def reading_options() -> list[str]:
    """Return the options of the command line that have recordings read as now."""
    usual = READING.get()
    options = ["--partial"] if usual.partial else []
    rate = None if usual.rate_hz is None else f"{usual.rate_hz:g}"
    told = (("--units", usual.units), ("--up", usual.up), ("--rate", rate))
    for option, value in (*told, ("--subject", usual.subject)):
        options += [] if value is None else [option, value]
    return options + (["--topic", ",".join(usual.topics)] if usual.topics else [])
