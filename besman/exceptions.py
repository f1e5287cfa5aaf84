"""Errors a user can meet. Every message is one line: what, where, got, expected, allowed."""

import difflib
import re
import shlex
import signal
from collections.abc import Iterable

# Where a C++ library found the fault in its own source: nothing that a user can act on.
_IN_SOURCE = re.compile(r"(From file|in function|at line):|at line \d+ in /")
_LABEL = re.compile(r"^(message|Error|Exception):\s*")

LONGEST_MESSAGE = 4000
"""Characters of a message that are shown."""


class BesmanError(Exception):
    """Base of all errors that besman raises on purpose; the command line shows them as one line.

    Messages quote names and values from files, so what would begin a second line or steer a
    terminal is written as in Python's source.
    """

    def __str__(self) -> str:
        return one_line(super().__str__())


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


class OutOfReachError(PlanError):
    """A block's goal that is out of reach.

    Attributes
    ----------
    label : str
        The block.
    """

    def __init__(self, message: str, label: str) -> None:
        super().__init__(message)
        self.label = label


class RefinementError(BesmanError):
    """A task or search that cannot be run."""


class TransferError(BesmanError):
    """A try on the real arm that cannot be suggested or recorded."""


class VerificationError(BesmanError):
    """Motions that cannot be tried in a second engine."""


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


def one_of(allowed: Iterable[str]) -> str:
    """Name what is allowed in an error message: ``a, b or c``."""
    *others, last = allowed
    return f"{', '.join(others)} or {last}" if others else last


def pasted(file: str) -> str:
    """Return a file as it can be pasted into a command line: quoted, and no option.

    Parameters
    ----------
    file : str
        A path; one that begins with a dash gets ``./`` before it.
    """
    return shlex.quote(f"./{file}" if file.startswith("-") else file)


def see_look(file: str) -> str:
    """Return the end of a message about a recording: the command that says what is in it.

    Parameters
    ----------
    file : str
        The recording, as a user would type it.
    """
    return f"; see: besman look {pasted(file)}"


def one_line(text: str) -> str:
    """Return a text with everything that is not printable written as in Python's source.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
        One line, cut after `LONGEST_MESSAGE` characters.
    """
    if len(text) > LONGEST_MESSAGE:
        text = text[:LONGEST_MESSAGE] + " ..."
    if text.isprintable():
        return text
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode() for one in text
    )


class StoppedError(BaseException):
    """A signal asks the process to end: no error of a stage, and nothing that one may catch.

    Attributes
    ----------
    exit_code : int
        128 and the signal's number, as shells have it.
    """

    def __init__(self, number: int) -> None:
        name = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
        super().__init__(f"stopped by {name}")
        self.exit_code = 128 + number


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
    # Nobody's misspelling is longer, and comparing takes the square of the length.
    close = difflib.get_close_matches(str(name)[:100], names, n=1, cutoff=0.5)
    listed = ", ".join(names) if names else "nothing"
    return (f"did you mean {close[0]!r}? " if close else "") + f"allowed: {listed}"


def in_one_line(error: BaseException | Iterable[str]) -> str:
    """Say in one line what an error of another library means, however many lines it has.

    Parameters
    ----------
    error : exception, or lines of text
        What was raised, or what a library wrote.

    Returns
    -------
    str
        All that was said but for places in the library's own source; the kind of the error where
        that is nothing, or no more than a key.
    """
    text = str(error) if isinstance(error, BaseException) else "\n".join(error)
    said = ""
    for line in text.splitlines():
        line = _LABEL.sub("", " ".join(line.split()))
        if not line or _IN_SOURCE.match(line):
            continue
        ends = said.endswith((".", ",", ":", ";", "(", "[")) or line.startswith((")", "]"))
        said += f"{' ' if ends else '; '}{line}" if said else line
    if isinstance(error, BaseException) and (not said or isinstance(error, KeyError)):
        return f"{type(error).__name__}{': ' if said else ''}{said}"
    return said


def why_not_there(error: ImportError, library: str, requirement: str) -> str:
    """Say that a library is not installed, or else why it cannot be loaded.

    Parameters
    ----------
    error : ImportError
        What came of importing it.
    library : str
        Its name, as it is installed.
    requirement : str
        What to install.
    """
    module = library.replace("-", "_")
    if isinstance(error, ModuleNotFoundError) and (error.name or "").split(".")[0] == module:
        return f"{library} is not installed; pip install '{requirement}'"
    return f"{library} cannot be loaded: {in_one_line(error)}"
