"""Xsens MVNX: positions and orientations of the segments of a sensor suit, as XML."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np

from besman.exceptions import RecordingError
from besman.foreign.numbers import has_odd_digits, parse_number, parse_whole_number
from besman.io.atomic_files import write_text
from besman.io.recordings.clock import RowClock, settle_clock
from besman.io.warning import warn_of_file
from besman.records import FloatArray, Recording
from besman.records.recordings import GREATEST_FRAME, RATES_HZ

# Frames of these types show calibration poses, not the recording.
_RECORDED = "normal"
_VALUES = {"position": 3, "orientation": 4}
# What is wrong with XML that ends too early.
_CUT = {
    expat.errors.XML_ERROR_NO_ELEMENTS,
    expat.errors.XML_ERROR_UNCLOSED_TOKEN,
    expat.errors.XML_ERROR_PARTIAL_CHAR,
    expat.errors.XML_ERROR_UNCLOSED_CDATA_SECTION,
}


def read_mvnx(path: Path, partial: bool = False) -> Recording:
    """Read the segments of an MVNX file.

    Parameters
    ----------
    path : Path
        The file.
    partial : bool
        Take the whole frames of a file that was cut.

    Returns
    -------
    Recording
        One trajectory a segment (``RightHand``, ``T8``, ...): its origin in metres and, if the
        file has them, its orientation. ``first_frame`` is the index of the first frame and
        time is ``index / rate``.

    Raises
    ------
    RecordingError
        If the file is missing, cut, no MVNX, declares a document type or entities, has two
        segments with one name, or its frames do not rise; the message names the line.

    Warns
    -----
    RecordingWarning
        If frames are missing, which become gaps.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    return _Parser(path).parse(content, partial)


def write_mvnx(recording: Recording, path: Path) -> None:
    """Write an MVNX file; the same recording gives the same bytes.

    Parameters
    ----------
    recording : Recording
        Segments by name, without gaps; positions and quaternions are rounded to 1e-6.
    path : Path
        The file; replaced if it exists.

    Raises
    ------
    RecordingError
        If a segment has no name or a gap, which the format does not know, or the file cannot be
        written.
    """
    for index, name in enumerate(recording.names):
        if name is None or not np.isfinite(recording.positions[:, index]).all():
            raise RecordingError(
                f"{path}: segment {index + 1} ({name or 'unnamed'}) has no name or has gaps; "
                "MVNX knows only named segments in every frame"
            )
    n_samples, n_segments = recording.positions.shape[:2]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<mvnx version="4" xmlns="http://www.xsens.com/mvn/mvnx">',
        f'<subject frameRate="{recording.rate_hz:.12g}" segmentCount="{n_segments}">',
        "<segments>",
        *(
            f'<segment id="{index}" label={quoteattr(name or "")}/>'
            for index, name in enumerate(recording.names, start=1)
        ),
        "</segments>",
        f'<frames segmentCount="{n_segments}">',
    ]
    times_ms = np.round((recording.time - recording.time[0]) * 1000.0).astype(np.int64)
    for row in range(n_samples):
        index = recording.first_frame + row
        lines.append(f'<frame time="{times_ms[row]}" index="{index}" type="{_RECORDED}">')
        if recording.orientations is not None:
            lines.append(_element("orientation", recording.orientations[row]))
        lines.append(_element("position", recording.positions[row]))
        lines.append("</frame>")
    lines += ["</frames>", "</subject>", "</mvnx>", ""]
    write_text(path, "\n".join(lines), durable=False, kind=RecordingError)


def _element(tag: str, values: FloatArray) -> str:
    """Return one line of numbers as an element."""
    flat = (np.round(values, 6) + 0.0).ravel().tolist()
    return f"<{tag}>{' '.join(['%.6f'] * len(flat)) % tuple(flat)}</{tag}>"


class _Parser:
    """Collect what is needed while the XML parser runs over the file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tags: list[str] = []
        self.text: list[str] | None = None
        self.n_subjects = 0
        self.subject: dict[str, str] = {}
        self.segments: list[str] = []
        self.is_recorded = False
        self.frame: dict[str, FloatArray] = {}
        self.has_orientations: bool | None = None
        self.index: int | None = None
        self.time_ms = -np.inf
        self.indices: list[int] = []
        self.times_ms: list[float] = []
        self.lines: list[int] = []
        self.positions: list[FloatArray] = []
        self.orientations: list[FloatArray] = []
        self.xml = expat.ParserCreate()
        self.xml.buffer_text = True
        self.xml.StartDoctypeDeclHandler = self._refuse
        self.xml.EntityDeclHandler = self._refuse
        self.xml.StartElementHandler = self._start
        self.xml.EndElementHandler = self._end
        self.xml.CharacterDataHandler = self._collect

    def parse(self, content: bytes, partial: bool) -> Recording:
        """Read the whole file; of one that was cut, if that will do, the frames before."""
        try:
            self.xml.Parse(content, True)
        except expat.ExpatError as error:
            reason = expat.errors.messages[error.code]
            what = f"{error.lineno}: not valid XML: {reason}; is the file cut?"
            can_be_taken = reason in _CUT and bool(self.positions)
            if not (partial and can_be_taken):
                take = " --partial takes what is there" if can_be_taken else ""
                raise RecordingError(f"{self.path}:{what}{take}") from None
            warn_of_file(
                f"{self.path.name}:{what} Its first {len(self.positions)} frames are taken"
            )
        except (ValueError, LookupError) as error:
            raise RecordingError(f"{self.path}: not valid XML: {error}") from None
        rate_hz = self._rate()
        if not self.positions:
            raise RecordingError(f"{self.path}: no frames of type {_RECORDED!r}; is the file cut?")
        clock = self._settle_clock(rate_hz)
        shape = len(self.positions), len(self.segments), -1
        orientations = None
        if self.orientations:
            orientations = clock.spread(np.array(self.orientations).reshape(shape))
        return Recording(
            time=clock.time,
            positions=clock.spread(np.array(self.positions).reshape(shape)),
            names=tuple(self.segments),
            rate_hz=clock.rate_hz,
            source=self.path.name,
            first_frame=clock.first_frame,
            orientations=orientations,
        )

    def _settle_clock(self, rate_hz: float) -> RowClock:
        """Tell when the frames were; of those that are missing too."""
        n_frames = len(self.positions)
        frames, times = np.array(self.indices[:n_frames]), np.array(self.times_ms[:n_frames]) / 1e3
        if (np.diff(frames) == 1).all():
            return RowClock(frames / rate_hz, rate_hz, int(frames[0]), None)
        clock = settle_clock(frames.astype(float), times, rate_hz, self.path, self.lines)
        return replace(clock, time=clock.time - clock.time[0] + frames[0] / rate_hz)

    def _fail(self, message: str) -> NoReturn:
        """Raise an error that names the line."""
        raise RecordingError(f"{self.path}:{self.xml.CurrentLineNumber}: {message}")

    def _refuse(self, name: str, *_: object) -> None:
        """Refuse document types and entities: no recording has them, only attacks."""
        self._fail(f"declares the document type or entity {name!r}; a recording has none")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        """Open an element."""
        tag = tag.rpartition(":")[2]
        if not self.tags and tag != "mvnx":
            self._fail(f"the root element is {tag!r}; expected 'mvnx'")
        if tag == "subject":
            self.n_subjects += 1
            self.subject = attributes
            if self.n_subjects > 1:
                self._fail("a second subject; expected one subject a file")
        elif tag == "segment" and self.tags[-1:] == ["segments"]:
            self._add_segment(attributes.get("label", ""))
        elif tag == "frame":
            self.is_recorded = attributes.get("type", _RECORDED) == _RECORDED
            self.frame = {}
            if self.is_recorded:
                self._check_clock(attributes)
        elif tag in _VALUES and self.tags[-1:] == ["frame"] and self.is_recorded:
            self.text = []
        self.tags.append(tag)

    def _end(self, tag: str) -> None:
        """Close an element."""
        tag = self.tags.pop()
        if self.text is not None and tag in _VALUES:
            self.frame[tag] = self._numbers(tag, "".join(self.text))
            self.text = None
        elif tag == "frame" and self.is_recorded:
            self._end_frame()

    def _collect(self, text: str) -> None:
        """Keep the text of an element that is wanted."""
        if self.text is not None:
            self.text.append(text)

    def _add_segment(self, label: str) -> None:
        """Add a segment by its name."""
        if not label or label in self.segments:
            what = f"two segments are named {label!r}" if label else "a segment has no label"
            self._fail(f"{what}; expected each name once")
        self.segments.append(label)

    def _check_clock(self, attributes: dict[str, str]) -> None:
        """Check index and time of a frame against the frame before."""
        text = attributes.get("index", str(0 if self.index is None else self.index + 1))
        try:
            self.index = parse_whole_number(text)
        except ValueError:
            self.index = -1
        if not 0 <= self.index <= GREATEST_FRAME:
            self._fail(
                f"frame index is {text!r:.60}; expected a whole number from 0 to "
                f"{GREATEST_FRAME:.0e}"
            )
        if "time" in attributes:
            try:
                time_ms = parse_number(attributes["time"])
            except ValueError:
                time_ms = float("nan")
            if not (np.isfinite(time_ms) and time_ms > self.time_ms):
                self._fail(
                    f"time is {attributes['time']!r:.60} ms after {self.time_ms:g} ms; "
                    "expected rising times"
                )
            self.time_ms = time_ms
        self.indices.append(self.index)
        self.times_ms.append(self.time_ms if "time" in attributes else np.nan)
        self.lines.append(self.xml.CurrentLineNumber)

    def _numbers(self, tag: str, text: str) -> FloatArray:
        """Return the values of one frame, checked."""
        try:
            values = np.array(text.split(), dtype=np.float64)
        except ValueError:
            values = np.array([np.nan])
        if has_odd_digits(text):
            values = np.array([np.nan])
        expected = _VALUES[tag] * len(self.segments)
        if len(values) != expected or not np.isfinite(values).all():
            self._fail(
                f"{tag} of frame {self.index}: got {len(text.split())} values, expected {expected} "
                f"numbers for {len(self.segments)} segments"
            )
        if tag == "orientation":
            quaternions = values.reshape(-1, 4)
            # The squares of what is much larger overflow.
            lengths = np.linalg.norm(np.clip(quaternions, -2.0, 2.0), axis=1)
            if np.any(np.abs(lengths - 1.0) > 0.01):
                self._fail(f"orientation of frame {self.index}: expected unit quaternions")
            values = (quaternions / lengths[:, None]).ravel()
        return values

    def _end_frame(self) -> None:
        """Keep a frame."""
        if "position" not in self.frame or not self.segments:
            self._fail(f"frame {self.index} has no position of segments; export segment positions")
        has_orientation = "orientation" in self.frame
        if self.has_orientations is None:
            self.has_orientations = has_orientation
        if has_orientation != self.has_orientations:
            self._fail(f"frame {self.index}: expected orientations in all frames or in none")
        self.positions.append(self.frame["position"])
        if has_orientation:
            self.orientations.append(self.frame["orientation"])

    def _rate(self) -> float:
        """Return frames per second and check the number of segments."""
        text = self.subject.get("frameRate", "")
        slowest, fastest = RATES_HZ
        try:
            rate_hz = parse_number(text)
        except ValueError:
            rate_hz = -1.0
        if not slowest <= rate_hz <= fastest:
            raise RecordingError(
                f"{self.path}: frameRate of the subject is {text!r:.60}; expected frames per "
                f"second, {slowest:g} to {fastest:g}"
            )
        declared = self.subject.get("segmentCount", str(len(self.segments)))
        if declared != str(len(self.segments)):
            raise RecordingError(
                f"{self.path}: got {len(self.segments)} segments, expected segmentCount "
                f"{declared:.60}"
            )
        return rate_hz
