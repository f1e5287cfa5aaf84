#!/usr/bin/env bash
# Pinocchio 4: what buildModelFromMJCF leaves out of a fixed-base arm that MuJoCo compiles.
#
# An MJCF arm usually hangs on a body without a joint that has a pose in the world, and <actuator>
# says what its motors can do. The pose of that body is dropped, so that the arm stands at the
# world's origin, and an actuator's forcerange is not read: only a joint's actuatorfrcrange is.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" \
    pin==4.1.0 mujoco==4.0.0 numpy==2.4.6 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
cd "$place"
site=$place/packages/cmeel.prefix/lib/python3.$(python3 -c 'import sys; print(sys.version_info[1])')/site-packages
PYTHONPATH=$place/packages:$site python3 - <<'PY'
import sys
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

MJCF = """<mujoco model="arm"><compiler autolimits="true"/><worldbody>
<body name="base" pos="0.3 0 0.8"><inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>
  <body name="upper" pos="0 0 0.2"><joint name="shoulder" axis="0 1 0" range="-2 2" actuatorfrcrange="-40 40"/>
    <inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/>
    <body name="fore" pos="0 0 0.4"><joint name="elbow" axis="0 1 0" range="-2 2"/>
      <inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/></body></body></body></worldbody>
<actuator><motor name="m1" joint="shoulder" forcerange="-40 40"/><motor name="m2" joint="elbow" forcerange="-20 20"/></actuator>
</mujoco>"""
Path("arm.xml").write_text(MJCF)
compiled = mujoco.MjModel.from_xml_path("arm.xml")
data = mujoco.MjData(compiled)
mujoco.mj_forward(compiled, data)
place = data.xanchor[0]
model = pin.buildModelFromMJCF("arm.xml")
state = model.createData()
pin.forwardKinematics(model, state, pin.neutral(model))
found = state.oMi[model.getJointId("shoulder")].translation
print("pinocchio", pin.__version__, "mujoco", mujoco.__version__)
print("the shoulder in the world: mujoco", place.tolist(), "pinocchio", found.round(6).tolist())
effort = np.array(model.upperEffortLimit)
print("effort limits: mujoco", compiled.actuator_forcerange[:, 1].tolist(), "pinocchio", effort.tolist())
if not np.allclose(place, [0.3, 0.0, 1.0]) or not np.allclose(found, [0.0, 0.0, 0.2]):
    sys.exit("changed: the pose of the root body is taken now")
if effort[0] != 40.0 or np.isfinite(effort[1]):
    sys.exit("changed: the efforts of the actuators are taken now")
PY
