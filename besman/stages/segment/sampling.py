"""Recordings made ready for a segmentation method, and its borders brought back to them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.exceptions import SegmentationError
from besman.records import LabelledRecording, Segments
from besman.stages.segment.signals import resample

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


# A step of time may differ by this share from the mean: clocks and rounded files do.
_UNEVEN = 0.1


def gather_gapless_paths(recording: LabelledRecording, markers: tuple[str, ...]) -> FloatArray:
    """Stack the paths of markers, shape (T, m, 3), metres; refuse gaps and uneven time.

    Raises
    ------
    SegmentationError
        If a marker was not seen throughout, there are fewer than two samples, or time steps differ.
    """
    if len(recording.time) < 2:
        raise SegmentationError(
            f"{recording.source}: got {len(recording.time)} samples; expected at least 2"
        )
    steps = np.diff(recording.time)
    uneven = np.abs(steps * recording.rate_hz - 1) > _UNEVEN
    if uneven.any():
        row = int(np.argmax(uneven))
        raise SegmentationError(
            f"{recording.source}: frame {recording.first_frame + row + 1} comes "
            f"{steps[row]:.4g} s after the one before; expected {1 / recording.rate_hz:.4g} s "
            f"throughout ({recording.rate_hz:g} Hz)"
        )
    paths = np.stack([recording.marker(name) for name in markers], axis=1)
    seen = np.isfinite(paths).all(axis=2)
    if not seen.all():
        row, column = np.argwhere(~seen)[0]
        raise SegmentationError(
            f"{recording.source}: marker {markers[column]!r} was not seen in frame "
            f"{recording.first_frame + row}; expected no gaps"
        )
    return paths


def sample_paths(
    recording: LabelledRecording, markers: tuple[str, ...], rate_hz: float
) -> tuple[FloatArray, float]:
    """Stack the paths of markers at a lower rate; refuse gaps.

    Parameters
    ----------
    recording : LabelledRecording
        Where the paths are taken from.
    markers : tuple of str
        m markers.
    rate_hz : float
        Samples per second; a recording with a lower rate is taken as it is.

    Returns
    -------
    paths : array, shape (T, m, 3)
        Metres.
    rate_hz : float
        Samples per second of the paths.

    Raises
    ------
    SegmentationError
        If a marker was not seen throughout, there are fewer than two samples, or time steps differ.
    """
    paths = gather_gapless_paths(recording, markers)
    rate_hz = min(rate_hz, recording.rate_hz)
    samples = resample(recording.time, paths, rate_hz)
    if len(samples) < 2:
        raise SegmentationError(
            f"{recording.source}: lasts {len(paths) / recording.rate_hz:.3g} s, which is "
            f"{len(samples)} sample at {rate_hz:g} Hz; expected at least 2"
        )
    return samples, rate_hz


def to_rows(borders: IntArray, rate_hz: float, recording: LabelledRecording) -> IntArray:
    """Bring borders at the rate of a method to rows of the recording; the last is its end.

    Parameters
    ----------
    borders : int array, shape (S + 1,)
        Rising sample indices at `rate_hz`.
    rate_hz : float
        Samples per second of the method.
    recording : LabelledRecording
        Whose rows are asked for.

    Returns
    -------
    int array, shape (S + 1,)
    """
    rows = np.round(borders * (recording.rate_hz / rate_hz)).astype(np.int64)
    rows[-1] = len(recording.time)
    return rows


def spread_over_rows(
    values: FloatArray, rate_hz: float, recording: LabelledRecording
) -> FloatArray:
    """Give every row of a recording the value of the nearest sample of a method.

    Parameters
    ----------
    values : array, shape (R,)
        Values at the rate of a method.
    rate_hz : float
        Samples per second of the method.
    recording : LabelledRecording
        T rows.

    Returns
    -------
    array, shape (T,)
    """
    nearest = np.round(np.arange(len(recording.time)) * (rate_hz / recording.rate_hz))
    return values[np.minimum(nearest.astype(np.int64), len(values) - 1)]


def to_segments(
    borders: IntArray,
    rate_hz: float,
    recording: LabelledRecording,
    log_evidence: float,
    border_probability: FloatArray | None = None,
) -> Segments:
    """Make segments of borders at the rate of a method; see `to_rows` and `spread_over_rows`."""
    expected = np.empty(0)
    if border_probability is not None:
        expected = spread_over_rows(border_probability, rate_hz, recording)
    rows = to_rows(borders, rate_hz, recording)
    return Segments(
        bounds=np.stack([rows[:-1], rows[1:]], axis=1),
        log_evidence=log_evidence,
        rate_hz=recording.rate_hz,
        source=recording.source,
        first_frame=recording.first_frame,
        border_probability=expected,
    )
