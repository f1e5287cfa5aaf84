"""All segmentation methods under one key: ``segment: {method: ...}``.

Which there are says `besman.stages.segment.kinds.SEGMENTATIONS`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import BeforeValidator, Field

from besman.stages.segment.hand_segmentation import SegmentingStage
from besman.stages.segment.kinds import SEGMENTATIONS
from besman.stages.segment.stage import ValleyVmciConfig

DefaultSegmentConfig = ValleyVmciConfig

CONFIGS: dict[str, type[SegmentingStage]] = {entry.name: entry.load() for entry in SEGMENTATIONS}
"""The stage of each method."""

DEFAULT_METHOD: str = DefaultSegmentConfig.model_fields["method"].default

if TYPE_CHECKING:
    SegmentMethod = SegmentingStage
else:
    SegmentMethod = Union[tuple(CONFIGS.values())]  # noqa: UP007


def _default_method(value: Any) -> Any:
    """Take the default method where none is named."""
    if isinstance(value, dict) and "method" not in value:
        return {"method": DEFAULT_METHOD, **value}
    return value


SegmentStage = Annotated[
    SegmentMethod, Field(discriminator="method"), BeforeValidator(_default_method)
]
