#!/usr/bin/env bash
# MuJoCo 4: a <body> that stands beside <worldbody>, not in it, is checked and then passed over.
#
# <geom> and <site> there are refused ("unrecognized element"); <body> and <frame> load without a
# word, and what is in them is not in the model. What refers to it is refused as unknown. So a part
# that is meant to be included elsewhere loads by itself as an empty world.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" \
    mujoco==4.0.0 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
PYTHONPATH=$place/packages python3 - <<'PY'
import sys

import mujoco

ARM = '<body name="arm"><joint name="hinge"/><geom size="0.1"/></body>'
MODELS = {
    "in <worldbody>": f"<worldbody>{ARM}</worldbody>",
    "beside it": f"<worldbody/>{ARM}",
    "in a <frame> beside it": f"<worldbody/><frame>{ARM}</frame>",
    "a <geom> beside it": '<worldbody/><geom size="0.1"/>',
    "beside it, with a motor": f'<worldbody/>{ARM}<actuator><motor joint="hinge"/></actuator>',
}


def load(inner):
    try:
        model = mujoco.MjModel.from_xml_string(f"<mujoco>{inner}</mujoco>")
        return f"{model.nbody - 1} bodies, {model.njnt} joints"
    except ValueError as error:
        return f"ValueError: {' '.join(str(error).split())}"


print("mujoco", mujoco.__version__)
found = {name: load(inner) for name, inner in MODELS.items()}
for name, told in found.items():
    print(f"{name}: {told}")
expected = ["1 bodies", "0 bodies", "0 bodies", "ValueError", "ValueError"]
if not all(told.startswith(one) for told, one in zip(found.values(), expected)):
    sys.exit("changed: bodies outside <worldbody> are no longer passed over")
PY
