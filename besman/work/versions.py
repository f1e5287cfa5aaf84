"""What a result was made with: besman's own code and the libraries it stands on."""

from __future__ import annotations

import hashlib
import platform
import subprocess
from functools import lru_cache
from importlib import metadata
from pathlib import Path

import besman

# What computes results: arithmetic, kernels, kinematics, distances, simulation, searches.
_COMPUTE = (
    "numpy",
    "scipy",
    "numba",
    "pin",
    "coal",
    "mujoco",
    "cma",
    "scikit-learn",
)


# A process runs the code that it has loaded, whatever becomes of the files.
@lru_cache(maxsize=1)
def code_version() -> str:
    """Return the SHA-256 of besman's own source, so that changed code re-runs its stages."""
    sha = hashlib.sha256()
    root = Path(besman.__file__).parent
    for path in sorted(root.rglob("*.py")):
        sha.update(path.relative_to(root).as_posix().encode())
        sha.update(path.read_bytes())
    return sha.hexdigest()


def library_versions() -> dict[str, str]:
    """Return the versions of Python, besman and the libraries that results depend on."""
    versions = {"besman": besman.__version__, "python": platform.python_version()}
    return versions | {name: _version(name) for name in (*_COMPUTE, "pydantic")}


def result_versions(others: tuple[str, ...] = ()) -> dict[str, str]:
    """Return the versions that can change a result: with another one, it is computed again.

    Parameters
    ----------
    others : tuple of str
        Libraries that a stage's method needs besides.
    """
    python = ".".join(platform.python_version_tuple()[:2])
    return {"python": python, **{name: _version(name) for name in (*_COMPUTE, *others)}}


@lru_cache(maxsize=64)
def _version(library: str) -> str:
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return "not installed"


@lru_cache(maxsize=1)
def commit() -> str:
    """Return the checkout's commit, or ``installed`` outside of one."""
    folder = Path(besman.__file__).parent
    if not (folder.parent / ".git").exists():
        return "installed"
    command = ["git", "-C", str(folder), "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=5, check=False)  # noqa: S603
    except (OSError, subprocess.TimeoutExpired):
        return "unknown"
    return done.stdout.strip() or "unknown"


@lru_cache(maxsize=1)
def environment() -> dict[str, str]:
    """Return what must be the same in two processes for the same results: code and versions."""
    return {**library_versions(), "code": code_version()[:12]}
