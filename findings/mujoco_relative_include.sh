#!/usr/bin/env bash
# MuJoCo 4: whether a model's meshes are found depends on whether its path is relative.
#
# scene/arm.xml includes parts/assets.xml, which names ../meshes/box.obj. By an absolute path the mesh
# is found beside the file that names it; by a relative path the same model does not load, and the
# error names a file that is there (as seen from where the program runs).
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" \
    mujoco==4.0.0 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
mkdir -p "$place/work/scene/parts" "$place/work/scene/meshes"
cd "$place/work"
PYTHONPATH=$place/packages python3 - <<'PY'
import sys
from pathlib import Path

import mujoco

scene = Path("scene")
(scene / "meshes/box.obj").write_text(
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
)
(scene / "parts/assets.xml").write_text(
    '<mujoco><asset><mesh name="box" file="../meshes/box.obj"/></asset></mujoco>'
)
(scene / "arm.xml").write_text(
    '<mujoco><include file="parts/assets.xml"/>'
    '<worldbody><geom type="mesh" mesh="box"/></worldbody></mujoco>'
)


def load(path):
    try:
        return f"{mujoco.MjModel.from_xml_path(str(path)).nmesh} mesh"
    except ValueError as error:
        return f"ValueError: {' '.join(str(error).split())}"


found = {path: load(path) for path in (scene / "arm.xml", (scene / "arm.xml").absolute())}
print("mujoco", mujoco.__version__)
for kind, told in zip(("relative", "absolute"), found.values()):
    print(f"{kind}: {told}")
if [told.startswith("ValueError") for told in found.values()] != [True, False]:
    sys.exit("changed: relative and absolute paths load the same now")
PY
