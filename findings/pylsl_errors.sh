#!/usr/bin/env bash
# pylsl 1.18: `except pylsl.LostError` and `except TimeoutError` catch nothing: the first is no name of the package, the second is another class.
#
# The docstrings of StreamInlet say that it throws LostError and TimeoutError. Both live in pylsl.util alone since the package
# has modules; its TimeoutError is a RuntimeError and not Python's, and a handler that names pylsl.LostError ends in AttributeError
# when the stream is lost, the very moment that it is for.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" \
    pylsl==1.18.6 numpy==2.4.6 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
cd "$place"
# Announced on this machine alone.
printf '[multicast]\nResolveScope = machine\n' >lsl_api.cfg
LSLAPICFG=$place/lsl_api.cfg PYTHONPATH=$place/packages python3 - <<'PY' 2>"$place/log" || { cat "$place/log"; exit 1; }
import sys
from importlib.metadata import version

import pylsl
import pylsl.util

print("pylsl", version("pylsl"))


def open_inlet(name):
    outlet = pylsl.StreamOutlet(pylsl.StreamInfo(name, "MoCap", 3, 100.0, "float32", ""))
    (found,) = pylsl.resolve_byprop("name", name, 1, 5.0)
    inlet = pylsl.StreamInlet(found, recover=False)
    inlet.open_stream(5.0)
    return outlet, inlet


def told(call, wanted):
    """Call in a handler as the docstrings have it; return what comes out."""
    try:
        try:
            call()
        except wanted():
            return "caught"
    except Exception as error:
        return f"{type(error).__module__}.{type(error).__name__}: {error}"
    return "nothing raised"


outlet, inlet = open_inlet("lost")
outlet.push_sample([1.0, 2.0, 3.0])
inlet.pull_sample(5.0)
del outlet
lost = told(lambda: [inlet.pull_sample(0.5) for _ in range(20)], lambda: pylsl.LostError)
print("a stream that is lost, except pylsl.LostError:", lost)

silent = pylsl.StreamInlet(pylsl.StreamInfo("silent", "MoCap", 3, 100.0, "float32", "x"))
slow = told(lambda: silent.info(0.3), lambda: TimeoutError)
print("a stream that does not answer, except TimeoutError:", slow)
print("pylsl.util.TimeoutError is Python's:", issubclass(pylsl.util.TimeoutError, TimeoutError))
if "AttributeError" not in lost or hasattr(pylsl, "LostError"):
    sys.exit("changed: the package has LostError")
if "pylsl.util.TimeoutError" not in slow:
    sys.exit("changed: Python's TimeoutError catches it")
PY
