#!/usr/bin/env bash
# coal 3 (with Pinocchio 4): a COLLADA mesh in inches is read as if it were in metres.
#
# <unit name="inch" meter="0.0254"/> says how long the file's unit is. Gazebo and RViz scale by it, so
# ROS packages ship such meshes with no scale in their URDF (kuka_kr210_support, for one). coal reads
# the vertices as they are, and so do Pinocchio's geometry models: links come in 39.4 times too large.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" \
    pin==4.1.0 numpy==2.4.6 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
site=$place/packages/cmeel.prefix/lib/python3.$(python3 -c 'import sys; print(sys.version_info[1])')/site-packages
PYTHONPATH=$place/packages:$site python3 - "$place" <<'PY'
import sys
from importlib import metadata
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{unit}<up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">0 0 0 10 0 0 0 10 0 0 0 10</float_array>
<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
URDF = """<robot name="a"><link name="l"><collision><geometry><mesh filename="{}"/></geometry>
</collision></link></robot>"""
print("coal", metadata.version("coal"), "pinocchio", pin.__version__)
found = {}
for name, unit in (("metre", '<unit name="meter" meter="1"/>'), ("inch", '<unit name="inch" meter="0.0254"/>')):
    file = Path(sys.argv[1]) / f"{name}.dae"
    file.write_text(DAE.format(unit=unit))
    direct = np.ptp(coal.MeshLoader().load(str(file), np.ones(3)).vertices(), axis=0)
    text = URDF.format(file)
    geometry = pin.buildGeomFromUrdfString(pin.buildModelFromXML(text), text, pin.GeometryType.COLLISION)
    by_urdf = np.ptp(geometry.geometryObjects[0].geometry.vertices(), axis=0)
    found[name] = direct.max()
    print(f"10 units of one {name}: coal {direct.max():g} m, Pinocchio by a URDF {by_urdf.max():g} m")
if abs(found["inch"] - 10.0) > 1e-6 or abs(found["metre"] - 10.0) > 1e-6:
    sys.exit("changed: the unit of a COLLADA file is heeded now")
PY
