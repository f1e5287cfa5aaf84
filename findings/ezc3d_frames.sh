#!/usr/bin/env bash
# ezc3d 1.7: a file of more than 65 535 frames is written and read without a word; the frames beyond are gone.
#
# The header counts frames with 16 bits. Ten minutes at 120 Hz are more than that.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" \
    ezc3d==1.7.2 numpy==2.4.6 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
cd "$place"
PYTHONPATH=$place/packages python3 - <<'PY'
import sys
from importlib.metadata import version

import ezc3d
import numpy as np

print("ezc3d", version("ezc3d"))
for frames in (65_535, 65_536, 70_000):
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = ["hand"]
    points = np.ones((4, 1, frames))
    points[0, 0] = np.arange(frames)
    file["data"]["points"] = points
    file.write("hour.c3d")
    back = ezc3d.c3d("hour.c3d")
    got = back["data"]["points"].shape[2]
    header = back["header"]["points"]
    print(f"written {frames}, read {got}; header {header['first_frame']} to {header['last_frame']}; POINT:FRAMES {back['parameters']['POINT']['FRAMES']['value'].tolist()}")
    if got != min(frames, 65_535):
        sys.exit("changed: another number of frames comes back")
PY
