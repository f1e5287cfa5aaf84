"""How recordings are read: what their files leave open, or say wrongly."""

from __future__ import annotations

from pydantic import Field

from besman.config.stage import Config
from besman.io.recordings.format import Units
from besman.records import Axis
from besman.records.recordings import RATES_HZ


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
    rate_hz : float, optional
        Frames per second, whatever files say; of files that say no rate it is needed.
    subject : str, optional
        Of files with several people or things, as ``Ann:RELB`` and ``Bob:RELB``, the one that is
        taken, besides what is nobody's.
    topics : tuple of str
        Of bags of ROS messages the topics that are taken, if not all that fit.
    """

    units: Units | None = None
    up: Axis | None = None
    rate_hz: float | None = Field(default=None, ge=RATES_HZ[0], le=RATES_HZ[1])
    subject: str | None = None
    topics: tuple[str, ...] | None = None
