"""Asked to end: in time, in order, and with nobody left behind."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest
from places import TESTS, TOP

from besman.exceptions import StoppedError
from besman.work.stopping import GOES_ON, SIGNALS, last_words, stops_on_signals

# A long while in which nothing but C runs, without Python's lock.
STUCK = "hashlib.pbkdf2_hmac('sha256', b'', b'', 2_000_000_000)"
SCRIPT = """
import hashlib, sys, time
from pathlib import Path
from besman.exceptions import StoppedError
from besman.work.stopping import last_words, stops_on_signals

def note(words):
    Path(sys.argv[1]).write_text(words)

try:
    with stops_on_signals(lambda error: print(error, *error.__notes__, flush=True)):
        with last_words(note):
            print("ready", flush=True)
            {work}
except StoppedError as error:
    note(f"in order: {{error}}")
    print(error, *error.__notes__)
    sys.exit(error.exit_code)
"""


def hear_all():
    # Under nohup the tests themselves are deaf to SIGHUP, and whom they start would be.
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL)


def start(script, *arguments, **options):
    """Start a script; return it once it has printed a line."""
    options = {"preexec_fn": hear_all, **options}
    environment = {**os.environ, "PYTHONPATH": f"{TOP}:{TESTS}", "OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, "-c", script, *map(str, arguments)],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        **options,
    )
    assert process.stdout.readline()
    return process


def lives(process):
    """Tell whether it has not ended; it may do so while it is asked."""
    try:
        return process.is_running() and process.status() != "zombie"
    except psutil.NoSuchProcess:
        return False


def wait_for(condition):
    until = time.monotonic() + 240
    while not (found := condition()):
        assert time.monotonic() < until
        time.sleep(0.02)
    return found


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_ends_a_process_in_order(tmp_path, number):
    process = start(SCRIPT.format(work="time.sleep(600)"), tmp_path / "words")
    process.send_signal(number)
    said, _ = process.communicate()
    assert process.returncode == 128 + number
    name = "Ctrl-C" if number == signal.SIGINT else number.name
    assert said == f"stopped by {name} {GOES_ON}\n"
    assert (tmp_path / "words").read_text() == f"in order: stopped by {name}"


def test_what_does_not_come_back_is_ended_with_the_last_words(tmp_path):
    process = start(SCRIPT.format(work=STUCK), tmp_path / "words")
    watched = psutil.Process(process.pid)
    before = watched.cpu_times().user
    wait_for(lambda: watched.cpu_times().user > before + 0.3)
    process.send_signal(signal.SIGTERM)
    said, _ = process.communicate()
    assert process.returncode == 128 + signal.SIGTERM
    assert said == f"stopped by SIGTERM {GOES_ON}\n"
    assert (tmp_path / "words").read_text() == "stopped by SIGTERM"


def test_a_second_signal_does_not_disturb_the_end(tmp_path):
    ends = "except StoppedError as error:\n    print('ending', flush=True)\n    time.sleep(0.5)\n"
    script = SCRIPT.format(work="time.sleep(600)").replace("except StoppedError as error:\n", ends)
    process = start(script, tmp_path / "words")
    process.send_signal(signal.SIGINT)
    assert process.stdout.readline() == "ending\n"
    process.send_signal(signal.SIGINT)
    process.communicate()
    assert process.returncode in (130, -signal.SIGINT)


def test_what_was_ignored_before_stays_so(tmp_path):
    def ignore():
        hear_all()
        signal.signal(signal.SIGHUP, signal.SIG_IGN)

    process = start(SCRIPT.format(work="time.sleep(600)"), tmp_path / "words", preexec_fn=ignore)
    process.send_signal(signal.SIGHUP)
    process.send_signal(signal.SIGTERM)
    process.communicate()
    assert process.returncode == 128 + signal.SIGTERM


def test_handlers_are_as_they_were_afterwards():
    before = [signal.getsignal(number) for number in SIGNALS]
    with pytest.raises(StoppedError, match="stopped by SIGHUP") as caught:
        hang_up(before)
    assert caught.value.exit_code == 129
    assert caught.value.__notes__ == [GOES_ON]
    assert [signal.getsignal(number) for number in SIGNALS] == before


def hang_up(before):
    with stops_on_signals(print), last_words(print), last_words(print):
        assert [signal.getsignal(number) for number in SIGNALS] != before
        os.kill(os.getpid(), signal.SIGHUP)
        time.sleep(600)


WORKERS = """
import sys, worker_items
from besman.work.work import Work
from besman.work.workers import Workers

with Workers(2) as workers:
    print("ready", flush=True)
    Work(2, workers=workers).map(worker_items.mark, [sys.argv[1]] * 4, name=str, processes=1)
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_workers_end_with_who_started_them(tmp_path, number):
    process = start(WORKERS, tmp_path, stderr=subprocess.DEVNULL)
    wait_for(lambda: len(list(tmp_path.iterdir())) == 2)
    workers = [psutil.Process(int(path.name)) for path in tmp_path.iterdir()]
    # What a terminal sends to all of them is for the first process alone.
    for one in workers:
        for heard in SIGNALS:
            os.kill(one.pid, heard)
        assert lives(one)
    process.send_signal(number)
    process.communicate()
    wait_for(lambda: not any(map(lives, workers)))


@pytest.mark.parametrize("within", [stops_on_signals(print), last_words(print)])
def test_an_error_that_a_signal_led_to_is_the_signal_s(within):
    """A compiled module that is being loaded makes an ImportError of whatever is raised in it."""
    error = ImportError("initialization failed")
    error.__cause__ = StoppedError(signal.SIGTERM)
    with pytest.raises(StoppedError, match="stopped by SIGTERM"), within:
        raise error
    with pytest.raises(ImportError, match="no such module"), last_words(print):
        raise ImportError("no such module")
