"""Functions that worker processes find by their name."""

import hashlib
import os
import signal
import threading
import time
from pathlib import Path


def double(number):
    return 2 * number


def refuse_odd(number):
    if number % 2:
        raise ValueError(f"{number}\nis odd")
    return number


def die_of(number, deadly=(), marks=None):
    """Kill the own process for a deadly number; of one that is not, once."""
    if number in deadly:
        os.kill(os.getpid(), signal.SIGKILL)
    if marks is not None:
        mark = Path(marks) / str(number)
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return number


def linger(number):
    time.sleep(0.2)
    return number


class OddError(Exception):
    """An error that cannot be sent: it needs two arguments, and keeps one."""

    def __init__(self, first, second):
        super().__init__(f"{first} {second}")


def raise_unsendable(number):
    raise OddError("cannot be", "sent")


def mark(folder):
    """Say which process this is, and take long."""
    (Path(folder) / str(os.getpid())).touch()
    time.sleep(600)


def mark_and_compute(folder):
    """Say which thread this is, and take long in C, without Python's lock."""
    (Path(folder) / str(threading.get_ident())).touch()
    hashlib.pbkdf2_hmac("sha256", b"", b"", 2_000_000_000)
