#!/usr/bin/env bash
# Pinocchio 4.1.0 (its urdfdom): a link whose <inertial> leaves something out loses its collision shapes; no error is raised.
#
# Moments of inertia that are left out, or a mass without <inertia>: a line on the error stream, and the model is built, the
# mass in it, without the link's shapes. What looks for collisions finds none. yourdfpy 0.0.60 keeps the shapes.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" \
    pin==4.1.0 yourdfpy==0.0.60 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
cd "$place"
PYTHONPATH=$place/packages:$place/packages/cmeel.prefix/lib/python$(python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')/site-packages \
    python3 - 2>"$place/said.log" <<'PY'
import io
import sys
from importlib.metadata import version

import pinocchio
import yourdfpy

WHOLE = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
SHAPE = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
CASES = {
    "all six moments": f'<inertial><mass value="2"/>{WHOLE}</inertial>',
    "three moments": '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1"/></inertial>',
    "a mass alone": '<inertial><mass value="2"/></inertial>',
}
JOINT = ('<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
         '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>')
print("pin", version("pin"), "yourdfpy", version("yourdfpy"))
found = {}
for what, inertial in CASES.items():
    text = f'<robot name="r"><link name="a"/><link name="b">{inertial}{SHAPE}</link>{JOINT}</robot>'
    model = pinocchio.buildModelFromXML(text)
    shapes = pinocchio.buildGeomFromUrdfString(model, text, pinocchio.GeometryType.COLLISION)
    other = yourdfpy.URDF.load(io.BytesIO(text.encode()), build_scene_graph=False, load_meshes=False)
    found[what] = (model.inertias[1].mass, len(shapes.geometryObjects))
    print(f"{what}: mass {found[what][0]:g} kg, {found[what][1]} collision shapes; yourdfpy "
          f"{len(other.link_map['b'].collisions)}")
expected = {"all six moments": (2, 1), "three moments": (2, 0), "a mass alone": (2, 0)}
sys.exit(found != expected)
PY
echo "the shapes are lost, no error is raised"
