#!/usr/bin/env bash
# qtm-rt 3.1: connect() returns None alike where nobody listens and where the server does not speak the version that was asked for.
#
# No exception tells one from the other, and `await connect(...)` of a script that does not test for None fails a line later
# ('NoneType' object has no attribute ...). Only the log of the package has the reason.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m pip install --quiet --disable-pip-version-check --target "$place/packages" \
    qtm-rt==3.1.0 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
cd "$place"
PYTHONPATH=$place/packages python3 - <<'PY' 2>"$place/log" || { cat "$place/log"; exit 1; }
import asyncio
import logging
import struct
import sys
from importlib.metadata import version

import qtm_rt

print("qtm-rt", version("qtm-rt"))
ERROR, COMMAND = 0, 1
said = []


class Keep(logging.Handler):
    def emit(self, record):
        said.append(record.getMessage())


logging.getLogger("qtm_rt").addHandler(Keep(logging.WARNING))
logging.getLogger("qtm_rt").propagate = False


def send(writer, kind, text):
    writer.write(struct.pack("<II", 9 + len(text), kind) + text + b"\0")


async def old_server(reader, writer):
    """Greet, and answer a version as QTM does where it is newer than the server."""
    send(writer, COMMAND, b"QTM RT Interface connected")
    size, _ = struct.unpack("<II", await reader.readexactly(8))
    await reader.readexactly(size - 8)
    send(writer, ERROR, b"Version is not supported")
    await reader.read()
    writer.close()


async def main():
    server = await asyncio.start_server(old_server, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    refused = await qtm_rt.connect("127.0.0.1", port, version="1.25", timeout=2)
    print("another version:", refused, "| log:", said[-1])
    server.close()
    nobody = await qtm_rt.connect("127.0.0.1", port, version="1.25", timeout=2)
    print("nobody listens:", nobody, "| log:", said[-1])
    if refused is not None or nobody is not None:
        sys.exit("changed: connect tells them apart")


asyncio.run(main())
PY
