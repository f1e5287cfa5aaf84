#!/usr/bin/env bash
# example-robot-data 6.0: the UR3's URDF has the speeds and torques of the UR10.
#
# Universal Robots says 180 degrees/s (wrists 360) and 56, 56, 28, 12, 12, 12 Nm of the UR3: user manual
# and the article "Max. joint torques". A planner that believes the file asks six times the torque.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --no-deps --target "$place/packages" \
    example-robot-data==6.0.0 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
python3 - "$place/packages" <<'PY'
import sys
from pathlib import Path
from xml.etree import ElementTree

folder = next(Path(sys.argv[1]).rglob("ur_description/urdf"))
limits = {}
for arm in ("ur3", "ur10"):
    joints = ElementTree.parse(folder / f"{arm}_robot.urdf").iterfind("joint[@type='revolute']")
    found = [joint.find("limit") for joint in joints]
    limits[arm] = [(float(one.get("velocity")), float(one.get("effort"))) for one in found]
    print(arm, "rad/s, Nm:", limits[arm])
if limits["ur3"] != limits["ur10"]:
    sys.exit("changed: the UR3 has limits of its own")
PY
