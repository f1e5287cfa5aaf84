"""How recordings are read: what their files leave open, or say wrongly."""

from __future__ import annotations

from besman.config.stage import Config
from besman.io.recordings.format import Units
from besman.records import Axis


class ReadConfig(Config):
    """How recordings are read.

    Attributes
    ----------
    units : str, optional
        What the coordinates of files are in, ``m``, ``cm``, ``mm`` or ``in``, whatever they say;
        of formats that may say it wrongly or not at all. Without it what the file says, or the size
        of a person.
    up : str, optional
        The axis of the files' frame that points up: ``x``, ``y``, ``z``, ``-x``, ``-y`` or ``-z``.
        Without it what the file says, or what gravity, names of body parts or the floor show.
    """

    units: Units | None = None
    up: Axis | None = None
