"""One mutant tried: refused in words, taken, taken with a warning, or one of four failures."""

import contextlib
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fuzz.targets import TARGETS, draw

LONGEST_S = 2.0
MOST_BYTES = 1_000_000_000
GOOD = ("refused", "taken", "warned")
FAILED = ("traceback", "hang", "memory", "nonsense")


class Hang(BaseException):
    """Longer than is allowed; no reader's `except Exception` stops it."""


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant.

    Attributes
    ----------
    target, which : str
        What was broken.
    kind : str
        One of `GOOD` or `FAILED`.
    words : str
        The message, the last frames of a traceback, or what is nonsense.
    seconds : float
        Of CPU.
    """

    target: str
    which: str
    kind: str
    words: str
    seconds: float


@cache
def whole(name: str) -> tuple[str, str]:
    """Let a target read its whole files, once: it compiles and imports what it needs."""
    with tempfile.TemporaryDirectory() as folder:
        for file, content in TARGETS[name].files().items():
            (Path(folder) / file).write_bytes(content)
        found = TARGETS[name].read(Path(folder))
        problems = TARGETS[name].judge(Path(folder), found)
    return ("nonsense", "; ".join(problems)) if problems else ("taken", "")


def attempt(seed: int, number: int, only: str = "") -> Outcome:
    """Make mutant `number` of a seed and let its target read it; `only` as of `draw`."""
    name, files, which = draw(random.Random(f"{seed}:{number}"), only)
    whole(name)
    with tempfile.TemporaryDirectory() as folder:
        for file, content in files.items():
            (Path(folder) / file).write_bytes(content)
        began = time.process_time()
        kind, words = read(name, Path(folder))
        return Outcome(name, which, kind, words, time.process_time() - began)


def read(name: str, folder: Path) -> tuple[str, str]:
    """Let a target read a folder; return the kind of outcome and its words."""
    from besman.exceptions import BesmanError, RecordingWarning

    target = TARGETS[name]
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            with _limits():
                found = target.read(folder)
        except BesmanError as error:
            text = str(error)
            return ("refused", text) if text.isprintable() else ("nonsense", f"message {text!r}")
        except Hang:
            return "hang", _place()
        except MemoryError:
            return "memory", _place()
        except Exception as error:
            return "traceback", f"{type(error).__name__}: {error!s:.150} {_place()}"
    problems = target.judge(folder, found)
    foreign = [one for one in said if not issubclass(one.category, RecordingWarning)]
    if foreign:
        one = foreign[0]
        return "traceback", f"{one.category.__name__}: {one.message!s:.150} {one.filename[-40:]}"
    if said:
        return "warned", f"{said[0].message}"
    return ("nonsense", "; ".join(problems)) if problems else ("taken", "")


@contextlib.contextmanager
def _limits():
    """Allow 2 s of CPU and 1 GB more than now."""

    def stop(*_):
        raise Hang

    old = signal.signal(signal.SIGPROF, stop)
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + MOST_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (most, hard))
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, old)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def _place() -> str:
    frames = traceback.extract_tb(sys.exc_info()[2])
    own = [
        one for one in frames if "/besman/" in one.filename and "site-packages" not in one.filename
    ]
    places = [f"{Path(one.filename).name}:{one.lineno}" for one in (*own[-2:], frames[-1])]
    return f"({' '.join(dict.fromkeys(places))})"
