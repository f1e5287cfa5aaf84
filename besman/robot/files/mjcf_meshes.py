"""A MJCF whose meshes are not where it says: compiled with those that are there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from besman.foreign.paths import file_alike, is_file


def compile_without(path: Path) -> tuple[Any, list[str]]:
    """Compile a MJCF without the meshes that are missing.

    A file that is there but for its capitals is taken: other systems do not tell them apart.

    Parameters
    ----------
    path : Path
        The MJCF; that all its files may be read was checked before.

    Returns
    -------
    model : mujoco.MjModel
    notes : list of str
        What was left out or taken instead; empty where no mesh is missing.

    Raises
    ------
    ValueError
        If MuJoCo does not compile what is left.
    """
    import mujoco

    spec = mujoco.MjSpec.from_file(str(path))
    folder = path.parent / spec.meshdir
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
    return spec.compile(), notes
