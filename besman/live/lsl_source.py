"""Markers over Lab Streaming Layer.

The extra ``lsl``: ``pylsl``, whose wheels bring liblsl. A thread receives; who follows the stream
is not waited for.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from besman.exceptions import RecordingError, in_one_line, why_not_there
from besman.io.recordings.conventions import turn
from besman.io.recordings.lengths import UNIT_M, in_metres, parse_unit
from besman.live.stream import Inbox, Packet, StreamFormat
from besman.records import Axis

_FIND_S = 3.0
_PULL_S, _SECOND_S = 0.1, 1.0
# hand_top_X, hand_top.x, hand_top X, handX; or the type of a channel, as of motion capture in XDF.
_AXIS = re.compile(r"[ _.:/-]+([xyzXYZ])$|(?<=[a-z0-9])([XYZ])$")
_TYPE = re.compile(r"position\W?([xyz])$", re.IGNORECASE)


class LslSource:
    """``lsl:NAME``.

    Parameters
    ----------
    name : str
        Of the stream.
    source_id : str, optional
        Which of several streams of that name.
    units, up : str, optional
        What coordinates are in and which axis points up, where the user says it. Streams that say
        no unit are refused; z points up if nothing is said.
    wait_s : float
        How long a stream that had begun may be silent.
    """

    def __init__(
        self,
        name: str,
        source_id: str | None = None,
        units: str | None = None,
        up: Axis | None = None,
        wait_s: float = 10.0,
    ) -> None:
        self._stream, self._id, self._units, self._up = name, source_id, units, up
        self._name = f"lsl:{name}"
        self._inbox = Inbox(wait_s, time.perf_counter)
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def ended(self) -> bool:
        """See `besman.live.stream.Source.ended`."""
        return self._inbox.ended

    def open(self) -> StreamFormat:
        """Find the stream by its name; see `besman.live.stream.Source.open`."""
        try:
            import pylsl
        except (ImportError, RuntimeError) as error:
            if not isinstance(error, ImportError):
                raise RecordingError(f"{self._name}: {in_one_line(error):.200}") from None
            reason = why_not_there(error, "pylsl", "besman[lsl]")
            raise RecordingError(f"{self._name}: {reason}") from None
        announced = pylsl.resolve_byprop("name", self._stream, 1, _FIND_S)
        # Of two streams the second may be a moment behind the first.
        announced = announced and pylsl.resolve_byprop("name", self._stream, 2, _SECOND_S)
        chosen = self._choose(announced)
        flags = pylsl.proc_clocksync | pylsl.proc_threadsafe
        inlet = pylsl.StreamInlet(chosen, max_buflen=60, processing_flags=flags, as_numpy=True)
        try:
            about = inlet.info(_FIND_S)
            inlet.open_stream(_FIND_S)
        except Exception as error:
            raise RecordingError(
                f"{self._name}: is announced, but does not answer: {in_one_line(error):.120}"
            ) from None
        found, columns, scale = self._describe(about)
        self._thread = threading.Thread(
            target=self._receive, args=(inlet, columns, scale), daemon=True
        )
        return found

    def start(self) -> None:
        """Begin to take samples; the first of the connection is made by this."""
        if self._thread is not None:
            self._thread.start()

    def read(self, timeout_s: float) -> Packet | None:
        """Return the next packet; see `Source.read`."""
        return self._inbox.get(timeout_s)

    def close(self) -> None:
        """End the thread that receives."""
        self._closing.set()
        if self._thread is not None and self._thread.is_alive():
            self._thread.join(5 * _PULL_S)

    def _choose(self, found: Sequence[Any]) -> Any:
        """Return the one stream that is meant."""
        chosen = [one for one in found if self._id is None or one.source_id() == self._id]
        if len(chosen) == 1:
            return chosen[0]
        ids = ", ".join(f"{one.source_id()!r:.60} on {one.hostname()!r:.60}" for one in found)
        if not chosen:
            rest = f"; those of this name have the ids {ids}" if found else ""
            raise RecordingError(
                f"{self._name}: no such stream was found within {_FIND_S:g} s{rest}; expected one "
                "that is announced in this network"
            )
        which = f"say which: {self._name}?source_id=ID"
        if len({one.source_id() for one in chosen}) < len(chosen):
            which = "their ids do not tell them apart: end all but one, or give them other names"
        raise RecordingError(f"{self._name}: {len(chosen)} streams have this name: {ids}; {which}")

    def _describe(self, about: Any) -> tuple[StreamFormat, list[list[int]], float]:
        """Return what comes, the channels of each marker, and metres a unit."""
        names, columns, scale = self._read_channels(about)
        rate_hz = float(about.nominal_srate())
        if not rate_hz > 0:
            raise RecordingError(
                f"{self._name}: says no rate (got {rate_hz:g} Hz); expected an even one"
            )
        return StreamFormat(self._name, names, rate_hz), columns, scale

    def _read_channels(self, about: Any) -> tuple[tuple[str | None, ...], list[list[int]], float]:
        """Return the names of markers, the channels of their x, y, z, and metres a unit."""
        labels = about.get_channel_labels() or []
        if not any(labels) and about.channel_count() % 3 == 0:
            return self._read_unnamed(about)
        return self._read_named(about, labels)

    def _read_named(
        self, about: Any, labels: Sequence[str]
    ) -> tuple[tuple[str, ...], list[list[int]], float]:
        types = about.get_channel_types() or [None] * len(labels)
        units = about.get_channel_units() or [None] * len(labels)
        places: dict[str, dict[str, int]] = {}
        said: dict[int, str] = {}
        for channel, (label, kind, unit) in enumerate(zip(labels, types, units, strict=False)):
            found = _find_axis(label or "", kind or "")
            if found is not None:
                places.setdefault(found[0], {})[found[1]] = channel
                said[channel] = unit or ""
        markers = {name: one for name, one in places.items() if name and set(one) == set("xyz")}
        if not markers:
            first = ", ".join(repr(label) for label in labels[:4]) or "none"
            raise RecordingError(
                f"{self._name}: no channels that are markers; got labels {first:.120}; expected "
                "NAME_X, NAME_Y, NAME_Z of each"
            )
        columns = [[one[axis] for axis in "xyz"] for one in markers.values()]
        words = {said[channel] for channels in columns for channel in channels}
        return tuple(markers), columns, self._find_scale(words)

    def _read_unnamed(self, about: Any) -> tuple[tuple[None, ...], list[list[int]], float]:
        """Take channels that do not say what they are for x, y, z of one point after the other."""
        scale = self._find_scale({unit or "" for unit in about.get_channel_units() or [""]})
        channels = np.arange(about.channel_count()).reshape(-1, 3)
        return (None,) * len(channels), channels.tolist(), scale

    def _find_scale(self, words: set[str]) -> float:
        """Return metres a unit, as the user says or the channels do."""
        if self._units is not None:
            return UNIT_M[self._units]
        known = {parse_unit(word) for word in words}
        unit = next(iter(known))
        if len(known) != 1 or unit is None:
            said = ", ".join(sorted(repr(word) for word in words))
            raise RecordingError(
                f"{self._name}: channels are in {said:.80}; expected one unit of length: say it by "
                "--units"
            )
        return UNIT_M[unit]

    def _receive(self, inlet: Any, columns: list[list[int]], scale: float) -> None:
        """Pull samples until the source is closed."""
        from pylsl.util import LostError

        while not self._closing.is_set():
            try:
                sample, stamp = inlet.pull_sample(_PULL_S)
                if stamp is None:
                    continue
                positions = in_metres(np.asarray(sample, np.float64)[columns], scale)
            except LostError:
                # A stream without an id is not found again by liblsl.
                self._inbox.put(None)
                return
            except Exception as error:
                self._inbox.put(RecordingError(f"{self._name}: {in_one_line(error):.200}"))
                return
            if self._up not in (None, "z"):
                positions = turn(positions, self._up)
            self._inbox.put(Packet(float(stamp), positions, time.perf_counter()))
        inlet.close_stream()


def _find_axis(label: str, kind: str) -> tuple[str, str] | None:
    """Return the marker and the axis that a channel is of; None if it is no position."""
    by_label, by_kind = _AXIS.search(label), _TYPE.search(kind)
    if by_label is None or ("position" in kind.lower() and by_kind is None):
        return None
    return label[: by_label.start()], (by_kind.group(1) if by_kind else label[-1]).lower()
