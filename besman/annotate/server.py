"""What the page asks for, and what it is answered."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import besman.web
from besman.annotate.session import Session
from besman.exceptions import AnnotationError, BesmanError, ChangedError, WebError
from besman.web.loopback import (
    Answer,
    LoopbackServer,
    Request,
    find_assets,
    json_answer,
)

_PAGE = Path(__file__).parent / "page"


def make_server(session: Session, port: int | None = None) -> LoopbackServer:
    """Make the server of a session's page.

    Parameters
    ----------
    session : Session
    port : int, optional
        Any free one if not given.

    Raises
    ------
    WebError
        If the port is in use.
    """
    assets = {**find_assets(_PAGE), **find_assets(Path(besman.web.__file__).parent, "web/")}
    routes = _Routes(session)
    return LoopbackServer(
        assets,
        {
            "GET session": routes.about,
            "GET recording": routes.recording,
            "GET revision": routes.revision,
            "GET chunk": routes.chunk,
            "GET frames": routes.frames,
            "GET sketch": routes.sketch,
            "GET stretches": routes.stretches,
            "POST names": routes.names,
            "POST candidates": routes.candidates,
            "POST naming": routes.naming,
            "POST save": routes.save,
        },
        port,
    )


class _Routes:
    """The answers of one session."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def about(self, request: Request) -> Answer:
        """Describe the session."""
        return json_answer(self._session.about())

    def recording(self, request: Request) -> Answer:
        """Describe a recording, with its segments as they are in the file now."""
        take = self._session.take(request.query.get("recording", ""))
        take.document.load()
        return json_answer(take.about())

    def revision(self, request: Request) -> Answer:
        """Tell what stands in the segments file now, by its digest."""
        take = self._session.take(request.query.get("recording", ""))
        return json_answer({"revision": take.document.store.revision()})

    def chunk(self, request: Request) -> Answer:
        """Return a piece of a curve, see `besman.annotate.signals.SignalPyramids.chunk`."""
        signals = self._session.take(request.query.get("recording", "")).signals
        marker, level, index = (request.whole(name) for name in ("marker", "level", "index"))
        return _binary(signals.chunk(request.query.get("group", ""), marker, level, index))

    def frames(self, request: Request) -> Answer:
        """Return a piece of all places, see `besman.annotate.signals.SignalPyramids.frames`."""
        signals = self._session.take(request.query.get("recording", "")).signals
        return _binary(signals.frames(request.whole("index")))

    def sketch(self, request: Request) -> Answer:
        """Return what is drawn first, see `besman.annotate.signals.SignalPyramids.sketch`."""
        signals = self._session.take(request.query.get("recording", "")).signals
        return _binary(signals.sketch()[0])

    def stretches(self, request: Request) -> Answer:
        """Return proposals, or a note that says why there are none: that is no failure."""
        take = self._session.take(request.query.get("recording", ""))
        try:
            found = take.stretches(request.query.get("layer", ""))
        except BesmanError as error:
            return json_answer({"stretches": [], "note": str(error)})
        return json_answer({"stretches": found, "note": ""})

    def names(self, request: Request) -> Answer:
        """Return proposals for the labels of stretches."""
        content = _content(request)
        take = self._session.take(content.get("recording"))
        n = len(take.recording.time)
        bounds = _bounds(content.get("bounds"), n)
        layer = str(content.get("layer", ""))
        return json_answer(self._session.name(take, layer, content.get("segments"), bounds))

    def candidates(self, request: Request) -> Answer:
        """Return the names that a fragment may get."""
        content = _content(request)
        take = self._session.take(content.get("recording"))
        names, fragment = _names(content.get("names")), content.get("fragment")
        if take.naming is None or type(fragment) is not int:
            raise AnnotationError(f"fragment: got {fragment!r:.20}, expected its number")
        return json_answer({"candidates": take.naming.candidates(fragment, names)})

    def naming(self, request: Request) -> Answer:
        """Give names to fragments, and write the recording with them if that is asked."""
        content = _content(request)
        take = self._session.take(content.get("recording"))
        revision = content.get("revision")
        if type(revision) is not int:
            raise AnnotationError(f"revision: got {revision!r:.20}, expected a whole number")
        try:
            take.give_names(_names(content.get("names")), revision)
        except ChangedError as error:
            return json_answer({"error": str(error), "changed": True}, 409)
        if content.get("write") is True:
            take.write_names()
        return json_answer(take.about())

    def save(self, request: Request) -> Answer:
        """Save segments; 409 if the file was changed underneath."""
        content = _content(request)
        document = self._session.take(content.get("recording")).document
        try:
            revision = document.save(
                content.get("segments"),
                str(content.get("revision", "")),
                replace=content.get("replace") is True,
                milestone=content.get("milestone") is True,
            )
        except ChangedError as error:
            return json_answer({"error": str(error), "changed": True}, 409)
        return json_answer({"revision": revision})


def _content(request: Request) -> dict[str, Any]:
    content = request.json()
    if not isinstance(content, dict):
        raise WebError(f"got {content!r:.80}, expected an object")
    return content


def _names(content: Any) -> dict[int, str]:
    """Check names of fragments."""
    if not isinstance(content, dict) or not all(
        key.isascii() and key.isdecimal() and len(key) < 9 and isinstance(name, str)
        for key, name in content.items()
    ):
        raise AnnotationError(f"names: got {content!r:.80}, expected a name for each fragment")
    return {int(key): name for key, name in content.items()}


def _bounds(rows: Any, n_samples: int) -> list[tuple[int, int]]:
    """Check half-open rows."""
    if not isinstance(rows, list):
        raise AnnotationError(f"bounds: got {rows!r:.80}, expected a list")
    for row in rows:
        whole = isinstance(row, list) and [type(value) for value in row] == [int, int]
        if not whole or not 0 <= row[0] < row[1] <= n_samples:
            raise AnnotationError(
                f"bounds: got {row!r:.80}, expected [start, end] in 0 to {n_samples}"
            )
    return [(row[0], row[1]) for row in rows]


def _binary(values: np.ndarray) -> Answer:
    return Answer(np.ascontiguousarray(values).data.cast("B"))
