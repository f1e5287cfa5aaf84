"""The process that workers are forked from begins before anything is loaded."""

import os
import subprocess
import sys
from pathlib import Path

from places import TOP

SCRIPT = """
import sys
import besman.work.fork_server
print(*(name for name in ("numpy", "joblib", "pydantic", "besman.records") if name in sys.modules))
"""


def test_it_needs_nothing_but_python():
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=TOP, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == []


LOADING = """
from besman.work.fork_server import server_pid, start_server
start_server(["this_takes_long"])
print(server_pid(), flush=True)
"""


def test_it_ends_with_its_owner_also_while_it_loads(tmp_path):
    (tmp_path / "this_takes_long.py").write_text("import time; time.sleep(30)")
    done = subprocess.run(
        [sys.executable, "-c", LOADING],
        cwd=TOP,
        env={**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{TOP}"},
        capture_output=True,
        text=True,
        check=True,
        timeout=20,
    )
    state = Path(f"/proc/{done.stdout.strip()}/stat")
    # Whoever takes it over may not have taken note of it yet.
    assert not state.exists() or state.read_text().rsplit(")", 1)[1].split()[0] == "Z"
