"""Tools that stand by themselves: ``tools/NAME.yaml``, for any flange whose z points outwards."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

from besman.config.resources import resource_folder
from besman.config.yaml_file import load_config
from besman.robot.config import RobotConfig, ToolConfig


@lru_cache(maxsize=1)
def shelf_tools() -> Mapping[str, ToolConfig]:
    """Return the tools of ``tools/``, by name."""
    files = sorted(resource_folder("tools").glob("*.yaml"))
    return MappingProxyType({file.stem: load_config(file, ToolConfig) for file in files})


def tools_of(config: RobotConfig) -> Mapping[str, ToolConfig]:
    """Return the tools of a robot: its own, or all that there are if it names none.

    Parameters
    ----------
    config : RobotConfig
    """
    return config.tools or shelf_tools()
