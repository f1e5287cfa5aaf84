"""How many words a frame of a C3D file has, and how many frames: where its own counts disagree.

The header counts analog words a frame: channels times samples a frame. Some programs write the
channels alone there, which would set every frame but the first in the wrong place. What the header
says is held against ANALOG:USED and against the length of the file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from besman.exceptions import RecordingError

MAX_FRAMES = 65_535
"""Frames that the header can count."""

BLOCK = 512
"""Bytes that sections of a file are rounded up to."""


class Layout(NamedTuple):
    """What the header says.

    Attributes
    ----------
    n_points, n_analog : int
        Points, and words of analog samples, of a frame.
    n_samples : int
        Analog samples a frame.
    first, last : int
        Numbers of frames.
    data_block : int
        Number of the block in which the frames begin, from 1.
    word_bytes : int
        4 of floats, 2 of integers.
    """

    n_points: int
    n_analog: int
    n_samples: int
    first: int
    last: int
    data_block: int
    word_bytes: int

    def frame_bytes(self, n_analog: int) -> int:
        """Return the bytes of a frame with so many analog words."""
        return (4 * self.n_points + n_analog) * self.word_bytes


def find_last_frame(
    layout: Layout, parameters: Mapping[str, Sequence[str | float]], room: int
) -> int:
    """Return the number of the last frame; beyond 65,535 the header cannot say it.

    Parameters
    ----------
    layout : Layout
    parameters : mapping
        By ``GROUP:NAME``.
    room : int
        Bytes from the first frame to the end of the file.
    """
    start, end = (_long(parameters.get(f"TRIAL:ACTUAL_{key}_FIELD", ())) for key in _ENDS)
    if start is None or end is None or end <= MAX_FRAMES or layout.last != MAX_FRAMES:
        return layout.last
    n_bytes = (end - start + 1) * layout.frame_bytes(layout.n_analog)
    return layout.first + end - start if 0 <= room - n_bytes < 2 * BLOCK else layout.last


_ENDS = ("START", "END")


def _long(words: Sequence[str | float]) -> int | None:
    """Return a number of two words of 16 bits, the lower first."""
    if not 1 <= len(words) <= 2 or any(isinstance(word, str) for word in words):
        return None
    low, high = [int(word) for word in words] + [0] * (2 - len(words))
    return low + (MAX_FRAMES + 1) * high


def find_analog_words(
    layout: Layout,
    parameters: Mapping[str, Sequence[str | float]],
    room: int,
    path: Path,
) -> tuple[int, str]:
    """Return how many analog words a frame has, and a note if the header says another number.

    Parameters
    ----------
    layout : Layout
    parameters : mapping
        By ``GROUP:NAME``.
    room : int
        Bytes from the first frame to the end of the file.
    path : Path
        Named in errors.

    Raises
    ------
    RecordingError
        If header, ANALOG:USED and the file's length are three opinions.
    """
    said, samples = layout.n_analog, max(1, layout.n_samples)
    used = parameters.get("ANALOG:USED", ())
    if len(used) != 1 or not isinstance(used[0], float):
        return said, ""
    channels = int(used[0])
    agrees = channels * samples == said
    others = {channels * _samples_by_rate(parameters)} - {said}
    if not agrees:
        others |= {channels * samples, said * samples} - {said}
    n_frames = layout.last - layout.first + 1

    def fits(n_analog: int) -> bool:
        # Frames end in the last block of the file.
        return 0 <= room - n_frames * layout.frame_bytes(n_analog) < BLOCK

    if fits(said):
        return said, ""
    fitting = sorted(other for other in others if fits(other))
    if len(fitting) != 1 and agrees:
        return said, ""
    if len(fitting) != 1:
        raise RecordingError(
            f"{path}: the header counts {said} analog words a frame and {layout.n_samples} samples "
            f"of each channel, ANALOG:USED {channels} channels, and neither makes {n_frames} "
            "frames as long as the file; is it cut or damaged?"
        )
    return fitting[0], (
        f"the header counts {said} analog words a frame; {fitting[0]} are there, as the length "
        "of the file says"
    )


def _samples_by_rate(parameters: Mapping[str, Sequence[str | float]]) -> int:
    """Return the analog samples a frame by the rates of both, 1 where these do not say."""
    rates = [parameters.get(f"{group}:RATE", ()) for group in ("ANALOG", "POINT")]
    if any(len(rate) != 1 or not isinstance(rate[0], float) or rate[0] <= 0 for rate in rates):
        return 1
    share = float(rates[0][0]) / float(rates[1][0])
    return max(1, round(share)) if share < MAX_FRAMES else 1
