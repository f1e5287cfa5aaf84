"""Errors a user can meet. Every message is one line: what, where, got, expected, allowed."""

import difflib
from collections.abc import Iterable


class BesmanError(Exception):
    """Base of all errors that besman raises on purpose; the command line shows them as one line."""


class ConfigError(BesmanError):
    """A pipeline, robot, task or marker file that cannot be used."""


class RecordingError(BesmanError):
    """A recording or segments file that cannot be read or does not fit."""


class RecordingWarning(UserWarning):
    """Something about a recording that was concluded from its data, not read from it."""


class LabellingError(BesmanError):
    """Markers that cannot be named or gaps that cannot be filled."""


class SegmentationError(BesmanError):
    """Data that cannot be segmented."""


class RecognitionError(BesmanError):
    """Training or test segments that cannot be classified."""


class RobotError(BesmanError):
    """A robot description that cannot be used."""


class MappingError(BesmanError):
    """Demonstrations that cannot be mapped to the robot."""


class PlanError(BesmanError):
    """A motion plan that cannot be made, or not for a start, goal or duration."""


class RefinementError(BesmanError):
    """A task or search that cannot be run."""


class TransferError(BesmanError):
    """A try on the real arm that cannot be suggested or recorded."""


class RunError(BesmanError):
    """A run folder that cannot be written or read."""


class FileError(BesmanError):
    """A file or folder that cannot be written."""


class WebError(BesmanError):
    """A page that cannot be served, or a request that cannot be answered."""


class AnnotationError(BesmanError):
    """Annotations that cannot be given or saved."""


class ChangedError(AnnotationError):
    """A file that another window or program changed in the meantime."""


class RenderingError(BesmanError):
    """A picture or video that cannot be made on this machine."""


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Say which allowed names there are and which is nearest, as the end of an error message.

    Parameters
    ----------
    name : str
        What was got.
    allowed : iterable of str
        What would be allowed.

    Returns
    -------
    str
        For example ``did you mean 'rate_hz'? allowed: marker, rate_hz``.
    """
    names = sorted(str(option) for option in allowed)
    close = difflib.get_close_matches(str(name), names, n=1, cutoff=0.5)
    listed = ", ".join(names) if names else "nothing"
    return (f"did you mean {close[0]!r}? " if close else "") + f"allowed: {listed}"
