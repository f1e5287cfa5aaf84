"""All segmentation methods under one key: ``segment: {method: ...}``."""

from __future__ import annotations

from typing import Annotated, Any, get_args

from pydantic import BeforeValidator, Field

from besman.stages.segment.rivals import BpArHmmConfig, LocminConfig, MciConfig, ProbsConfig
from besman.stages.segment.stage import SegmentConfig, ValleyVmciConfig, VmciOnlineConfig

DefaultSegmentConfig = ValleyVmciConfig

SegmentMethod = (
    ValleyVmciConfig
    | SegmentConfig
    | VmciOnlineConfig
    | MciConfig
    | LocminConfig
    | BpArHmmConfig
    | ProbsConfig
)

CONFIGS: dict[str, type[SegmentMethod]] = {
    config.model_fields["method"].default: config for config in get_args(SegmentMethod)
}
DEFAULT_METHOD: str = DefaultSegmentConfig.model_fields["method"].default


def _default_method(value: Any) -> Any:
    """Take the default method where none is named."""
    if isinstance(value, dict) and "method" not in value:
        return {"method": DEFAULT_METHOD, **value}
    return value


SegmentStage = Annotated[
    SegmentMethod, Field(discriminator="method"), BeforeValidator(_default_method)
]
