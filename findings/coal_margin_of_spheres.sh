#!/usr/bin/env bash
# coal 3: a security margin is lost where a mesh's tree is of swept spheres (BV_RSS) or kIOS.
#
# `CollisionRequest.security_margin` asks whether two shapes come nearer than that. The answer should
# not hang on the bounding volumes that a mesh is loaded with. With AABB, OBB and OBBRSS it does not;
# with BV_RSS and BV_kIOS most pairs that are apart by less than the margin are "no collision",
# without an error. Pairs that touch are found by all. A robot that keeps 2 cm away by such meshes
# keeps less.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" \
    coal==3.0.3 numpy==2.4.6 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
site=$place/packages/cmeel.prefix/lib/python3.$(python3 -c 'import sys; print(sys.version_info[1])')/site-packages
PYTHONPATH=$place/packages:$site python3 - "$place" <<'PY'
import sys
from pathlib import Path

import coal
import numpy as np

MARGIN_M = 0.02
random = np.random.default_rng(0)


def write_ball(file, stretch, count=16):
    """Write a ball of triangles, 0.1 m of radius and stretched, as Wavefront OBJ."""
    down = np.linspace(0.0, np.pi, count + 1)
    around = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    places = [(np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)) for a in down for b in around]
    lines = ["v {:.9f} {:.9f} {:.9f}".format(*(0.1 * np.array(one) * stretch)) for one in places]
    for row in range(count):
        for column in range(count):
            a, b = row * count + column + 1, row * count + (column + 1) % count + 1
            lines += [f"f {a} {a + count} {b}"] if row else []
            lines += [f"f {b} {a + count} {b + count}"] if row < count - 1 else []
    Path(file).write_text("\n".join(lines) + "\n")


def draw_place():
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    way = random.normal(size=3)
    return turn * np.sign(np.linalg.det(turn)), way / np.linalg.norm(way) * random.uniform(0.12, 0.34)


files = [f"{sys.argv[1]}/{name}.obj" for name in "ab"]
write_ball(files[0], (1.0, 1.0, 1.0))
write_ball(files[1], (1.0, 0.5, 2.0))
places = [coal.Transform3s(*draw_place()) for _ in range(500)]
here = coal.Transform3s()


def load(kind):
    loader = coal.MeshLoader(getattr(coal, kind))
    return [loader.load(file, np.ones(3)) for file in files]


one, other = load("BV_OBBRSS")
apart = np.array(
    [coal.distance(one, here, other, at, coal.DistanceRequest(), coal.DistanceResult()) for at in places]
)
near = (apart > 1e-6) & (apart < MARGIN_M - 1e-6)
touching = apart <= 0.0
print(f"coal {coal.__version__}; margin {MARGIN_M} m; {near.sum()} of {len(places)} places apart by less")
missed = {}
for kind in ("BV_AABB", "BV_OBB", "BV_OBBRSS", "BV_RSS", "BV_kIOS"):
    one, other = load(kind)
    request = coal.CollisionRequest()
    request.security_margin = MARGIN_M
    found = []
    for at in places:
        result = coal.CollisionResult()
        coal.collide(one, here, other, at, request, result)
        found.append(result.isCollision())
    found = np.array(found)
    missed[kind] = int((near & ~found).sum())
    print(f"{kind:10} misses {missed[kind]:3} of {near.sum()} that are near, {(touching & ~found).sum()} of {touching.sum()} that touch")
usual = [missed[kind] for kind in ("BV_AABB", "BV_OBB", "BV_OBBRSS")]
if any(usual) or min(missed["BV_RSS"], missed["BV_kIOS"]) < 0.3 * near.sum():
    sys.exit("changed: the margin is kept whatever the bounding volumes are, or by none")
PY
