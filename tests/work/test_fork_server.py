"""The process that workers are forked from begins before anything is loaded."""

import subprocess
import sys

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
