"""All kinds of motion plans under one key: ``imitate: {method: ...}``."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from besman.stages.imitate.stage import CartesianDmpConfig, ImitateConfig, VelocityDmpConfig

ImitateMethod = ImitateConfig | VelocityDmpConfig | CartesianDmpConfig


def _default_method(value: Any) -> Any:
    """Take the default method where none is named."""
    if isinstance(value, dict) and "method" not in value:
        return {"method": ImitateConfig.model_fields["method"].default, **value}
    return value


ImitateStage = Annotated[
    ImitateMethod, Field(discriminator="method"), BeforeValidator(_default_method)
]
