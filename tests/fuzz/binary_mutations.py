"""Broken C3D and `.npz` files; see `fuzz.mutations`."""

import io
import json
import zipfile

import numpy as np
from fuzz.mutations import cut, flip, nest, splice, tree
from fuzz.odd_values import NAMES

_FLOATS = (0.0, -1.0, 1.0, 1e30, -1e30, 3e38, 1e-38, 1e6, 5e5, float("nan"), float("inf"))


def c3d(rng, content):
    """Break C3D: header, parameters, numbers, end."""
    if rng.random() < 0.15:
        return rng.choice((cut, splice, flip))(rng, content)
    changed = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 4))):
        where = rng.random()
        last = min(len(changed), 24 if where < 0.4 else 3000 if where < 0.7 else len(changed)) - 4
        at = rng.randrange(max(1, last))
        kind = rng.randrange(4)
        if kind == 0:
            changed[at] = rng.randrange(256)
        elif kind == 1:
            changed[at : at + 2] = rng.choice((0, 1, 2, 255, 32768, 65535)).to_bytes(2, "little")
        elif kind == 2:
            at -= at % 4
            changed[at : at + 4] = np.float32(rng.choice(_FLOATS)).tobytes()
        else:
            name = rng.choice(NAMES).encode()[:8]
            changed[at : at + len(name)] = name
    return bytes(changed)


def npz(rng, content):
    """Break a record: arrays of other shape, type or values, and the tree around them."""
    if rng.random() < 0.1:
        return rng.choice((cut, splice, flip))(rng, content)
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    names = [name for name in arrays if name != "__tree__"]
    raw = {}
    if rng.random() < 0.5 and names:
        name = rng.choice(names)
        changed = _array(rng, arrays[name])
        if isinstance(changed, bytes):
            raw[name] = changed
        else:
            arrays[name] = changed
    else:
        changed = tree(rng, json.loads(str(arrays["__tree__"])))
        written = json.dumps(changed).encode("utf-8", "replace").decode()
        arrays["__tree__"] = np.array(nest(rng, "") if rng.random() < 0.02 else written)
    if rng.random() < 0.05:
        arrays.pop(rng.choice(list(arrays)))
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            file = io.BytesIO()
            np.lib.format.write_array(file, array, allow_pickle=True)
            archive.writestr(f"{name}.npy", raw.get(name) or file.getvalue())
    return buffer.getvalue()


def _array(rng, array):
    action = rng.randrange(9)
    if action == 0:
        return array[..., None]
    if action == 1:
        return array[:-1] if array.ndim else np.array([array])
    if action == 2:
        return np.concatenate([array, array]) if array.ndim else np.array([array, array])
    if action == 3:
        kind = rng.choice(("U8", "c16", "bool", "i1", "f2", "u8", "O", "M8[s]", "S4"))
        whole = np.nan_to_num(array.real).astype("i8") if array.dtype.kind in "fiub" else array
        return whole.astype(kind) if kind == "M8[s]" else array.astype(kind)
    if action == 4:
        return array.T.copy() if array.ndim > 1 else array[::-1].copy()
    if action == 5:
        return np.empty((0,) * array.ndim, array.dtype)
    if action == 6:
        header = io.BytesIO()
        described = {"descr": "<f8", "fortran_order": False, "shape": (10 ** rng.choice((9, 12)),)}
        np.lib.format.write_array_header_1_0(header, described)
        return header.getvalue()
    changed = array.astype(np.float64 if array.dtype.kind in "fiub" else array.dtype)
    if changed.size and changed.dtype.kind == "f":
        at = rng.randrange(changed.size)
        changed.flat[at] = rng.choice((np.nan, np.inf, -np.inf, 1e300, -1.0, 0.5, 1e9))
    return changed if rng.random() < 0.7 or array.dtype.kind == "f" else changed.astype(array.dtype)


def bag(rng, content):
    """Break a bag: lengths, counts and times anywhere, names, numbers, end."""
    if rng.random() < 0.3:
        return rng.choice((cut, splice, flip))(rng, content)
    changed = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(len(changed) - 8)
        kind = rng.randrange(5)
        if kind == 0:
            changed[at] = rng.randrange(256)
        elif kind == 1:
            changed[at : at + 4] = rng.choice((0, 1, 255, 2**20, 2**31, 2**32 - 1)).to_bytes(
                4, "little"
            )
        elif kind == 2:
            changed[at : at + 8] = rng.choice((0, 2**40, 2**63, 2**64 - 1)).to_bytes(8, "little")
        elif kind == 3:
            changed[at : at + 8] = np.float64(rng.choice(_FLOATS)).tobytes()
        else:
            name = rng.choice(NAMES).encode()[:8]
            changed[at : at + len(name)] = name
    return bytes(changed)
