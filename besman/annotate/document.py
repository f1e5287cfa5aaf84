"""The segments of one recording, between file and page.

On the page a segment is ``[start, end, label, layer]``: half-open rows of the recording, "" for no
layer. In the file it has the recording's frame numbers.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from besman.annotate.store import NO_FILE, Store
from besman.exceptions import AnnotationError
from besman.io.segments_json import parse_segments, read_content, segment_rows
from besman.io.segments_origin import ORIGIN, describe_origin
from besman.records import LabelledSegments, Recording

PageRow = list[Any]

_LONGEST_LABEL = 200


class Document:
    """A segments file with what else stands in it.

    Parameters
    ----------
    path : Path
        The file; need not be there.
    recording : Recording
        The recording that it belongs to.

    Raises
    ------
    BesmanError
        If the file cannot be written, or what it holds are not segments of this recording.
    """

    def __init__(self, path: Path, recording: Recording) -> None:
        self.path = path
        self.recording = recording.without_samples()
        self._origin = describe_origin(recording)
        self.store = Store(path)
        self._around: dict[str, Any] = {}
        self.segments, self.revision = self.load()

    def load(self) -> tuple[LabelledSegments, str]:
        """Read the file; return what it holds and its revision.

        Raises
        ------
        RecordingError
            If it does not hold segments of the recording.
        """
        content: Any = []
        # Once more if it is written in between.
        for _ in range(10):
            revision = self.store.revision()
            content = [] if revision == NO_FILE else read_content(self.path)
            if self.store.revision() == revision:
                break
        segments = parse_segments(
            content, self.recording, self.path, keep_parts=True, origin=self._origin
        )
        self._around = content if isinstance(content, dict) else {}
        self.segments, self.revision = segments, revision
        return segments, revision

    def save(self, rows: Any, base: str, *, replace: bool = False, milestone: bool = False) -> str:
        """Check the page's segments and write them.

        Parameters
        ----------
        rows : list of [start, end, label, layer]
        base, replace, milestone
            As in `Store.write`.

        Returns
        -------
        str
            The new revision.

        Raises
        ------
        BesmanError
            If the segments are none of this recording or overlap, or the file was changed or
            cannot be written. Then nothing is written.
        """
        segments = self.parse(rows)
        rows = segment_rows(segments)
        content = {**self._around, "segments": rows, ORIGIN: self._origin}
        text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
        revision = self.store.write(
            text.encode("utf-8"), base, replace=replace, milestone=milestone
        )
        self.segments, self.revision = segments, revision
        return revision

    def parse(self, rows: Any) -> LabelledSegments:
        """Check segments that a page sent, as those of a file are checked.

        Raises
        ------
        BesmanError
            If they are not segments of this recording, or overlap in a layer.
        """
        if not isinstance(rows, list):
            raise AnnotationError(f"segments: got {rows!r:.80}, expected a list")
        first = self.recording.first_frame
        content = []
        for number, row in enumerate(rows, start=1):
            if not isinstance(row, list) or [type(value) for value in row] != [int, int, str, str]:
                raise AnnotationError(
                    f"segment {number}: got {row!r:.80}, expected [start, end, label, layer]"
                )
            start, end, label, layer = row
            usual = label.strip() and len(label) <= _LONGEST_LABEL
            # What the file has already is not refused for its looks.
            if not usual and label not in self.segments.labels:
                raise AnnotationError(
                    f"segment {number}: label: got {len(label)} characters, expected 1 to "
                    f"{_LONGEST_LABEL}, not all of them spaces"
                )
            one = {"start index": start + first, "end index": end + first, "label": label}
            content.append(one | ({"layer": layer} if layer else {}))
        return parse_segments(content, self.recording, self.path, keep_parts=True)

    def page_rows(self) -> list[PageRow]:
        """Return the segments as the page has them."""
        layers = self.segments.layers or ("",) * len(self.segments.labels)
        return [
            [*bounds, label, layer]
            for bounds, label, layer in zip(
                self.segments.bounds.tolist(), self.segments.labels, layers, strict=True
            )
        ]
