#!/usr/bin/env bash
# MuJoCo 4.0 in Python: mjcb_time says None, and every step is timed all the same; setting it to None does not end that.
#
# One takes None for a profiler that is off. The Python package switches it on when it is imported, by a clock of its own that
# get_mjcb_time() does not show: each step reads the clock several times. Only another clock takes its place, and None brings the
# hidden one back.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" \
    mujoco==4.0.0 numpy==2.4.6 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
cd "$place"
PYTHONPATH=$place/packages python3 - <<'PY' 2>"$place/log" || { cat "$place/log"; exit 1; }
import sys

import mujoco

print("mujoco", mujoco.__version__)
PENDULUM = """<mujoco><worldbody><body><joint type="hinge"/><geom size="0.1" pos="0 0 -1"/></body>
</worldbody></mujoco>"""
model = mujoco.MjModel.from_xml_string(PENDULUM)


def timed():
    """Return what the profiler says 1000 steps took, microseconds; 0 where it is off."""
    data = mujoco.MjData(model)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    return 1e6 * data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration


found = {"after the import": (mujoco.get_mjcb_time(), timed())}
mujoco.set_mjcb_time(None)
found["after set_mjcb_time(None)"] = (mujoco.get_mjcb_time(), timed())
mujoco.set_mjcb_time(lambda: 0.0)
found["with a clock that stands still"] = ("a function", timed())
mujoco.set_mjcb_time(None)
found["after set_mjcb_time(None) again"] = (mujoco.get_mjcb_time(), timed())
for when, (callback, microseconds) in found.items():
    print(f"{when}: get_mjcb_time() is {callback}, 1000 steps took {microseconds:.0f} us by the profiler")
if not all(one[1] > 0 for when, one in found.items() if "stands" not in when):
    sys.exit("changed: None means that steps are not timed")
if found["after the import"][0] is not None:
    sys.exit("changed: the clock of the package is shown")
PY
