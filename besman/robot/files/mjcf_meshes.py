"""A MJCF compiled without pictures, and where meshes are missing with those that are there."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from besman.exceptions import in_one_line
from besman.foreign.paths import file_alike, is_file


def compile_bare(path: Path) -> tuple[Any, list[str]]:
    """Compile a MJCF without its pictures, and without the meshes that are missing.

    Textures and skins move nothing and are often left out of packages. A mesh that is there but for
    its capitals is taken: other systems do not tell them apart.

    Parameters
    ----------
    path : Path
        The MJCF; that all its files may be read was checked before.

    Returns
    -------
    model : mujoco.MjModel
    notes : list of str
        What was left out or taken instead.

    Raises
    ------
    ValueError
        If MuJoCo does not compile what is left.
    """
    spec = _load(path)
    try:
        return _compile(spec), []
    except ValueError as error:
        first = error
    # What was compiled before is not compiled again with less.
    spec = _load(path)
    notes = _strip_missing(spec, path)
    if not notes:
        raise first
    try:
        return _compile(spec), notes
    except ValueError as error:
        raise ValueError(f"{in_one_line(first)}; and without it: {in_one_line(error)}") from first


def _load(path: Path) -> Any:
    """Read a MJCF without its pictures."""
    import mujoco

    # By a relative path MuJoCo does not find the meshes that an included file names.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        spec = mujoco.MjSpec.from_file(str(path.absolute()))
    _strip_pictures(spec)
    return spec


def _compile(spec: Any) -> Any:
    """Compile; what a model would lose when it is saved is of no interest."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return spec.compile()


def _strip_pictures(spec: Any) -> None:
    """Take off textures and skins."""
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for one in [*spec.textures, *spec.skins]:
        spec.delete(one)


def _strip_missing(spec: Any, path: Path) -> list[str]:
    """Take off the meshes that are not there, and what is made of them; say so."""
    folder = path.absolute().parent / spec.meshdir
    notes, gone = [], set[str]()
    for mesh in list(spec.meshes):
        if not mesh.file or is_file(folder / mesh.file):
            continue
        alike = file_alike(folder / mesh.file)
        if alike is not None:
            notes.append(f"mesh {mesh.file}: {alike.name} is taken for it")
            mesh.file = str(Path(mesh.file).with_name(alike.name))
        else:
            notes.append(f"mesh {mesh.file}: no such file in {folder}")
            gone.add(mesh.name or Path(mesh.file).stem)
    for geom in list(spec.geoms):
        if geom.meshname in gone:
            spec.delete(geom)
    for mesh in list(spec.meshes):
        if (mesh.name or Path(mesh.file).stem) in gone:
            spec.delete(mesh)
    return notes
