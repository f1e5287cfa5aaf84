import subprocess
import sys

import pytest

from besman.exceptions import RunError
from besman.pipeline.run_lock import is_locked, take_lock

HOLD = """
import sys
from pathlib import Path
from besman.pipeline.run_lock import take_lock
lock = take_lock(Path(sys.argv[1]))
print("held", flush=True)
sys.stdin.read()
"""


def test_a_folder_belongs_to_one_process_until_it_ends_however_that_is(tmp_path):
    assert not is_locked(tmp_path)
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"held\n"
        assert is_locked(tmp_path)
        with pytest.raises(RunError, match="another besman is working here; wait or use --out"):
            take_lock(tmp_path)
        other.kill()
        other.wait()
    assert not is_locked(tmp_path)
    with take_lock(tmp_path):
        assert is_locked(tmp_path)
    assert not is_locked(tmp_path)


def test_a_folder_in_its_place_is_named(tmp_path):
    (tmp_path / ".lock").mkdir()
    with pytest.raises(RunError, match=r"\.lock: is a folder; expected a file: remove the folder"):
        take_lock(tmp_path)
    with pytest.raises(RunError, match=r"\.lock: cannot be written: No such file"):
        take_lock(tmp_path / "none")
