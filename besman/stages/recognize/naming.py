"""Segments of whole recordings get names."""

from __future__ import annotations

from besman.records import LabelledRecording, LabelledSegments, Segments
from besman.stages.recognize.model import RecognitionModel, name_segments
from besman.work.work import Work


def name_recordings(
    model: RecognitionModel,
    recordings: tuple[LabelledRecording, ...],
    segments: tuple[Segments | LabelledSegments, ...],
    work: Work = Work(),
) -> tuple[LabelledSegments, ...]:
    """Name the segments of recordings.

    Parameters
    ----------
    model : RecognitionModel
    recordings : tuple of LabelledRecording
    segments : tuple of Segments or LabelledSegments
        Of each recording, in the same order; labels are not looked at.
    work : Work

    Returns
    -------
    tuple of LabelledSegments
        The same segments with labels and their uncertainty.

    Raises
    ------
    RecognitionError
        If features cannot be made of a segment.
    """
    results = []
    for index, (recording, found) in enumerate(zip(recordings, segments, strict=True)):
        labels, uncertainty = name_segments(model, recording, found.bounds)
        results.append(
            LabelledSegments(
                found.bounds, labels, uncertainty, found.rate_hz, found.source, found.first_frame
            )
        )
        work.progress((index + 1) / len(recordings))
    return tuple(results)
