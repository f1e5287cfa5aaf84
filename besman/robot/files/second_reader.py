"""What a second reader of URDFs says about a file."""

from __future__ import annotations

import io
import logging
from pathlib import Path
from xml.etree import ElementTree

from besman.exceptions import RobotError, in_one_line
from besman.robot.urdf_file import text_for_model

_MOST_FAULTS = 3


def refuse_faults(tree: ElementTree.Element, urdf: Path) -> None:
    """Refuse what yourdfpy finds wrong in a URDF.

    Raises
    ------
    RobotError
    """
    import yourdfpy

    # The library logs what it then raises.
    logging.getLogger("yourdfpy.urdf").setLevel(logging.CRITICAL)
    text = text_for_model(tree).encode()
    try:
        robot = yourdfpy.URDF.load(io.BytesIO(text), build_scene_graph=False, load_meshes=False)
        robot.validate()
        faults = [in_one_line(error) for error in robot.errors]
    except (ValueError, TypeError, KeyError, AttributeError, IndexError) as error:
        faults = [in_one_line(error)]
    if faults:
        more = f"; and {len(faults) - _MOST_FAULTS} more" if len(faults) > _MOST_FAULTS else ""
        raise RobotError(
            f"{urdf}: cannot be used as URDF: {'; '.join(faults[:_MOST_FAULTS])}{more}"
        )
