"""Words on pictures: captions above panels that stand side by side, a line below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

Picture = npt.NDArray[np.uint8]

BAND = 32
_PAPER, _INK, _SOFT = (250, 250, 251), (28, 32, 36), (98, 103, 111)
_GAP = 2


def text_band(width: int, words: str, size: int = 16, soft: bool = False) -> Picture:
    """Draw words on a light band.

    Parameters
    ----------
    width : int
        Pixels.
    words : str
        Made smaller until they fit.
    size : int
        Of the letters, pixels.
    soft : bool
        Paler letters.

    Returns
    -------
    uint8 array, shape (BAND, width, 3)
    """
    band = Image.new("RGB", (width, BAND), _PAPER)
    draw = ImageDraw.Draw(band)
    while size > 8 and draw.textlength(words, font=ImageFont.load_default(size)) > width - 16:
        size -= 1
    font = ImageFont.load_default(size)
    draw.text((8, BAND / 2), words, font=font, fill=_SOFT if soft else _INK, anchor="lm")
    return np.array(band)


def join_panels(panels: Sequence[Picture], captions: Sequence[Picture], line: Picture) -> Picture:
    """Put panels side by side, each below its caption, and a line below all.

    Parameters
    ----------
    panels : sequence of uint8 arrays, shape (H, W, 3)
    captions : sequence of uint8 arrays, shape (BAND, W, 3)
    line : uint8 array, shape (BAND, W * len(panels), 3)

    Returns
    -------
    uint8 array, shape (H + 2 BAND, W * len(panels), 3)
    """
    columns = [np.concatenate(pair) for pair in zip(captions, panels, strict=True)]
    for column in columns[1:]:
        column[:, :_GAP] = _PAPER
    return np.concatenate([np.concatenate(columns, axis=1), line])
