"""Where robots, pipelines, configs and the sample are: in the checkout or inside the wheel."""

from pathlib import Path

from besman.exceptions import ConfigError, nearest
from besman.foreign.paths import is_file

_PACKAGE = Path(__file__).resolve().parents[1]


def resource_folder(kind: str) -> Path:
    """Return the folder of one kind of resource.

    Parameters
    ----------
    kind : str
        ``robots``, ``tools``, ``pipelines``, ``configs`` or ``data``.

    Returns
    -------
    Path
        The folder inside an installed wheel, else the one at the top of the checkout.
    """
    installed = _PACKAGE / "resources" / kind
    return installed if installed.is_dir() else _PACKAGE.parent / kind


def find_resource(kind: str, name: str, suffix: str = ".yaml") -> Path:
    """Return a user's own file if `name` is a path to one, else the resource of that name.

    Parameters
    ----------
    kind : str
        Folder below which to look, e.g. ``configs/markers``.
    name : str
        A path to a file, or a bare name such as ``right_arm``.
    suffix : str
        Ending of resource files.

    Returns
    -------
    Path
        An existing file.

    Raises
    ------
    ConfigError
        If there is no such file; the message lists what there is.
    """
    path = Path(name)
    if path.suffix == suffix and is_file(path):
        return path
    first, *rest = kind.split("/")
    folder = resource_folder(first).joinpath(*rest)
    found = folder / f"{name}{suffix}"
    if "/" not in name and "\\" not in name and is_file(found):
        return found
    names = [entry.stem for entry in folder.glob(f"*{suffix}")]
    raise ConfigError(
        f"{kind}: no file and no resource named {name!r:.200}; {nearest(name, names)}"
    )


def robot_title(name_or_path: str) -> str:
    """Return what a robot is called in tables and folders, without reading it.

    Parameters
    ----------
    name_or_path : str
        A robot's name, or the path of its file: ``NAME.yaml``, or ``robot.yaml`` in its own folder.
    """
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        return name_or_path
    return path.parent.name if path.stem == "robot" and path.parent.name else path.stem
