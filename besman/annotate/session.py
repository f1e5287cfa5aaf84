"""What is annotated at one time: recordings, the labels that are offered, what names proposals."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from besman.annotate.proposals import Name, Teacher, name_stretches
from besman.annotate.takes import Take, shares_side, side_of_layer
from besman.exceptions import AnnotationError, BesmanError
from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import read_recording
from besman.records import LabelledSegments
from besman.records.layers import LAYERS, drop_parts
from besman.stages.recognize.model import RecognitionModel


class Session:
    """Recordings that are annotated together: what is labelled in one helps with the others.

    Parameters
    ----------
    paths : sequence of Path
        Recordings or folders.
    segments : Path, optional
        Segments file, of a single recording.
    labels : sequence of str
        Labels to offer first.
    markers : str, optional
        Marker set; the first that fits if not given.
    models : sequence of RecognitionModel
        Trained models that name proposals too.
    teacher : Path, optional
        A recording with names, to name unnamed trajectories after.

    Raises
    ------
    BesmanError
        If a file cannot be read or must not be written, or does not fit.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        segments: Path | None = None,
        labels: Sequence[str] = (),
        markers: str | None = None,
        models: Sequence[RecognitionModel] = (),
        teacher: Path | None = None,
    ) -> None:
        found = find_recordings(paths)
        if segments is not None and len(found) > 1:
            raise AnnotationError(
                f"--segments {segments}: belongs to one recording, got {len(found)}; leave it out, "
                "and every recording has its own beside it"
            )
        named = None if teacher is None else read_recording(teacher)
        self.takes = [Take(path, segments, markers, named) for path in found]
        _refuse_shared_files(self.takes)
        self.labels = tuple(dict.fromkeys(labels))
        self._models = tuple(models)
        self._teacher = Teacher()
        self._lock = threading.Lock()

    def take(self, index: Any) -> Take:
        """Return a recording by its number in a request.

        Raises
        ------
        AnnotationError
            If there is none.
        """
        text = str(index)
        if text not in map(str, range(len(self.takes))):
            raise AnnotationError(
                f"recording: got {text!r:.20}, expected 0 to {len(self.takes) - 1}"
            )
        return self.takes[int(text)]

    def about(self) -> dict[str, Any]:
        """Return what the page needs to know before it draws."""
        return {
            "recordings": [take.path.name for take in self.takes],
            "labels": self.known_labels(),
            "layers": ["", *LAYERS],
        }

    def known_labels(self) -> list[str]:
        """Return the labels given, then those of models and files, each once."""
        of_models = [name for model in self._models for name in model.classes]
        of_files = [
            label for take in self.takes for label in drop_parts(take.document.segments).labels
        ]
        return list(dict.fromkeys([*self.labels, *of_models, *sorted(set(of_files))]))

    def name(
        self, take: Take, layer: str, rows: Any, bounds: list[tuple[int, int]]
    ) -> dict[str, Any]:
        """Name stretches of a recording after all that is labelled.

        Parameters
        ----------
        take : Take
        layer : str
        rows : list
            The take's segments as the page has them now.
        bounds : list of pair of int

        Returns
        -------
        dict
            ``names``: (label, confidence) or None for each; ``n_examples`` learnt from.

        Raises
        ------
        BesmanError
            If the segments are none of this recording.
        """
        now = take.document.parse(rows)
        side = side_of_layer(layer)
        names: list[Name | None] = [None] * len(bounds)
        n_examples = 0
        try:
            recording, _ = take.labelled()
        except BesmanError:
            # What is the matter stands where the borders would be.
            side = None
        if side is not None:
            labelled, truth = [], []
            for one in self.takes:
                segments = _of_side(now if one is take else one.document.segments, layer)
                if one is take or len(segments.labels):
                    try:
                        labelled.append(one.labelled()[0])
                        truth.append(replace(segments, source=str(one.path)))
                    except BesmanError:
                        # It teaches nothing; its own page says why.
                        continue
            with self._lock:
                learnt = self._teacher.learn(labelled, truth, side)
            n_examples = sum(len(one.labels) for one in truth)
            models = (*self._models, *([learnt] if learnt else []))
            names = name_stretches(models, recording, bounds)
        return {"names": names, "n_examples": n_examples}


def _of_side(segments: LabelledSegments, layer: str) -> LabelledSegments:
    """Return the segments that teach names for a layer."""
    layers = segments.layers or ("",) * len(segments.labels)
    return segments.take([k for k, name in enumerate(layers) if shares_side(layer, name)])


def _refuse_shared_files(takes: Sequence[Take]) -> None:
    """Refuse two recordings with one segments file."""
    owners: dict[Path, Take] = {}
    for take in takes:
        other = owners.setdefault(take.document.store.path, take)
        if other is not take:
            raise AnnotationError(
                f"{other.path} and {take.path} have the same segments file, {take.document.path}; "
                "annotate them one at a time with --segments"
            )
