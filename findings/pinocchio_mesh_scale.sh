#!/usr/bin/env bash
# Pinocchio 4: a mesh's vertices are scaled already, and meshScale still says by how much.
#
# GeometryModel.geometryObjects[i].meshScale looks like a factor that is yet to be applied to
# geometry.vertices(). It has been applied: whoever multiplies (capsules, convex hulls, drawings)
# gets a body that is too small by the factor again, and an arm that is "clear" while it touches.
# A mirroring scale is treated alike: the vertices are mirrored, and the factor is still -1.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" pin==4.1.0 numpy==2.4.6 >"$place/pip.log" 2>&1 \
    || { cat "$place/pip.log"; exit 1; }
cd "$place"
site=$place/packages/cmeel.prefix/lib/python3.$(python3 -c 'import sys; print(sys.version_info[1])')/site-packages
PYTHONPATH=$place/packages:$site python3 - <<'PY'
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin

# A box of 100 x 200 x 400, as an OBJ of twelve triangles.
corners = [(x, y, z) for x in (0, 100) for y in (0, 200) for z in (0, 400)]
faces = [(1, 2, 4), (1, 4, 3), (5, 7, 8), (5, 8, 6), (1, 5, 6), (1, 6, 2), (3, 4, 8), (3, 8, 7),
         (1, 3, 7), (1, 7, 5), (2, 6, 8), (2, 8, 4)]
lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
Path("box.obj").write_text("\n".join(lines) + "\n")
print("pinocchio", pin.__version__)
for scale, expected in (("0.001 0.001 0.001", (0.1, 0.2, 0.4)), ("0.001 -0.001 0.001", (0.1, -0.2, 0.4))):
    urdf = f"""<robot name="one"><link name="base"><collision><geometry>
    <mesh filename="box.obj" scale="{scale}"/></geometry></collision></link></robot>"""
    Path("one.urdf").write_text(urdf)
    model = pin.buildModelFromUrdf("one.urdf")
    geometry = pin.buildGeomFromUrdf(model, "one.urdf", pin.GeometryType.COLLISION, package_dirs=["."])
    (shape,) = geometry.geometryObjects
    vertices = np.array(shape.geometry.vertices())
    far = vertices[np.argmax(np.abs(vertices).sum(axis=1))]
    print(f"scale={scale!r}: farthest vertex {far.round(4).tolist()}, meshScale {np.round(shape.meshScale, 4).tolist()}")
    if not np.allclose(far, expected):
        sys.exit("changed: the vertices are no longer scaled")
    if not np.allclose(shape.meshScale, [float(word) for word in scale.split()]):
        sys.exit("changed: meshScale no longer repeats the URDF's scale")
PY
