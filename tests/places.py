"""Where things are that tests read."""

import os
from pathlib import Path

TESTS = Path(__file__).parent
TOP = TESTS.parent
DATA = TOP / "data"
SAMPLE = DATA / "stick_throw"
# Real recordings, which are no part of the project.
REAL_DATA = Path(os.environ.get("BESMAN_REAL_DATA", TOP.parent / "shared" / "data"))
