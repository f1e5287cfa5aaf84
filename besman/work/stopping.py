"""Asked to end from outside, by Ctrl-C, SIGTERM or SIGHUP: soon, and with everything in order."""

from __future__ import annotations

import os
import select
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from besman.exceptions import StoppedError

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

# Who asked is answered within two seconds, whatever a kernel is doing meanwhile.
_PATIENCE_S = 1.4

GOES_ON = "the same command goes on from here"

_last_words: list[Callable[[str], None]] = []


@contextmanager
def last_words(say: Callable[[str], None]) -> Iterator[None]:
    """Have something noted if what is done in here is stopped; the same command goes on then.

    Parameters
    ----------
    say : callable
        Takes why. Called at the latest moment, in another thread, if this process has to end in
        the middle of work.
    """
    _last_words.append(say)
    try:
        with _heard_through_errors():
            yield
    except StoppedError as error:
        if GOES_ON not in getattr(error, "__notes__", ()):
            error.add_note(GOES_ON)
        raise
    finally:
        _last_words.remove(say)


@contextmanager
def _heard_through_errors() -> Iterator[None]:
    """Raise the `StoppedError` that led to an error, as while a compiled module was loaded."""
    try:
        yield
    except Exception as error:
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, StoppedError):
            cause = cause.__cause__ or cause.__context__
        if cause is None:
            raise
        raise cause from None


@contextmanager
def stops_on_signals(farewell: Callable[[StoppedError], None]) -> Iterator[None]:
    """Raise `StoppedError` in the main thread when a signal asks this process to end.

    Signals that were ignored before stay so, as under ``nohup``. A second signal does not disturb
    what the first has begun. Where that takes longer than can be waited for, because a kernel does
    not come back, the last words are said and the process ends.

    Parameters
    ----------
    farewell : callable
        Called before it ends that way.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    usual = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: signal.getsignal(number) for number in SIGNALS}
    taken = [number for number, handler in before.items() if handler in usual]

    def stop(number: int, frame: FrameType | None) -> None:
        for other in taken:
            signal.signal(other, signal.SIG_IGN)
        raise StoppedError(number)

    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    # Written to at once by the system, also while Python is not running.
    woken = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    guard = threading.Thread(target=_guard, args=(reader, taken, farewell), daemon=True)
    guard.start()
    for number in taken:
        signal.signal(number, stop)
    try:
        with _heard_through_errors():
            yield
    finally:
        for number in taken:
            signal.signal(number, before[number])
        signal.set_wakeup_fd(woken)
        os.close(writer)
        guard.join()
        os.close(reader)


def _guard(
    reader: int, numbers: list[signal.Signals], farewell: Callable[[StoppedError], None]
) -> None:
    """Wait for a signal, and then for the end; end the process if that does not come in time."""
    while True:
        said = os.read(reader, 1)
        if not said:
            return
        if said[0] in numbers:
            break
    until = time.monotonic() + _PATIENCE_S
    while (left := until - time.monotonic()) > 0:
        ready, _, _ = select.select([reader], [], [], left)
        if ready and not os.read(reader, 1):
            return
    error = StoppedError(said[0])
    for say in reversed(_last_words):
        # What is in order without them must not keep the process from ending.
        with suppress(Exception):
            say(str(error))
    if _last_words:
        error.add_note(GOES_ON)
    farewell(error)
    os._exit(error.exit_code)
