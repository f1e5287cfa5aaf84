#!/usr/bin/env bash
# Pinocchio 4: a URDF whose joint and link share a name loads, and cannot be reduced.
#
# URDF keeps joints and links in name spaces of their own, and SolidWorks' exporter gives both one
# name. buildModelFromXML takes such an arm with both frames; buildReducedModel looks the locked
# joint's frame up by name alone, and raises for the one joint whose name is shared, not for others.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" \
    pin==4.1.0 numpy==2.4.6 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
site=$place/packages/cmeel.prefix/lib/python3.$(python3 -c 'import sys; print(sys.version_info[1])')/site-packages
PYTHONPATH=$place/packages:$site python3 - <<'PY'
import sys

import pinocchio as pin

LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
JOINT = (
    '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
)
links = LINK.format("base") + LINK.format("shoulder") + LINK.format("tip")
joints = JOINT.format("shoulder", "base", "shoulder") + JOINT.format("finger", "shoulder", "tip")
model = pin.buildModelFromXML(f'<robot name="arm">{links}{joints}</robot>')
print("pinocchio", pin.__version__, "joints", list(model.names)[1:])
print("frames called shoulder:", [str(one.type) for one in model.frames if one.name == "shoulder"])


def lock(name):
    try:
        return f"{pin.buildReducedModel(model, [model.getJointId(name)], pin.neutral(model)).nq} joint left"
    except ValueError as error:
        return f"ValueError: {error}"


print("lock finger:  ", lock("finger"))
print("lock shoulder:", lock("shoulder"))
if lock("finger") != "1 joint left" or not lock("shoulder").startswith("ValueError"):
    sys.exit("changed: a joint that shares its name with a link is locked now")
PY
