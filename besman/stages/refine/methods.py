"""All searches under one key: ``refine: {method: ...}``; one class with the keys of each.

Which there are says `besman.search.kinds.SEARCHES`. A key that not all have is an argument of the
search.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from pydantic import BeforeValidator, Field

from besman.search.kinds import SEARCHES
from besman.stages.refine.gauss_newton import GaussNewtonConfig as GaussNewtonConfig
from besman.stages.refine.stage import CmaEsConfig, RefinementConfig


class RepsConfig(RefinementConfig):
    """Refine every motion plan by relative entropy policy search.

    Attributes
    ----------
    method : "reps"
    population, memory : int
        Episodes per generation, and of how many generations it learns.
    epsilon : float
        Greatest relative entropy of one generation's distribution to the one before.
    """

    method: Literal["reps"]
    population: Annotated[int, Field(ge=2)] = 10
    memory: Annotated[int, Field(ge=1)] = 4
    epsilon: Annotated[float, Field(gt=0)] = 2.0


class Pi2Config(RefinementConfig):
    """Refine every motion plan by policy improvement with path integrals.

    Attributes
    ----------
    method : "pi2"
    population : int
        Episodes per generation.
    sharpness : float
        How much more the best of a generation counts than the worst: exp(sharpness).
    decay : float
        Of the exploration's standard deviation, from one generation to the next.
    """

    method: Literal["pi2"]
    population: Annotated[int, Field(ge=2)] = 10
    sharpness: Annotated[float, Field(gt=0)] = 10.0
    decay: Annotated[float, Field(gt=0, le=1)] = 0.98


class Pi2CmaConfig(RefinementConfig):
    """Refine every motion plan by PI2 that adapts the covariance of its exploration.

    Attributes
    ----------
    method : "pi2_cma"
    population, sharpness
        As in `Pi2Config`.
    """

    method: Literal["pi2_cma"]
    population: Annotated[int, Field(ge=2)] = 10
    sharpness: Annotated[float, Field(gt=0)] = 10.0


class CemConfig(RefinementConfig):
    """Refine every motion plan by the cross-entropy method.

    Attributes
    ----------
    method : "cem"
    population : int
        Episodes per generation.
    elite_share : float
        Share of them that the next generation is drawn around.
    """

    method: Literal["cem"]
    population: Annotated[int, Field(ge=4)] = 20
    elite_share: Annotated[float, Field(gt=0, le=1)] = 0.2


CONFIGS: dict[str, type[RefinementConfig]] = {
    entry.name: globals()[entry.config] for entry in SEARCHES
}
"""The class with the keys of each search."""

if TYPE_CHECKING:
    RefineMethod = RefinementConfig
else:
    RefineMethod = Union[tuple(CONFIGS.values())]  # noqa: UP007


def _default_method(value: Any) -> Any:
    """Take the default method where none is named."""
    if isinstance(value, dict) and "method" not in value:
        return {"method": CmaEsConfig.model_fields["method"].default, **value}
    return value


RefineStage = Annotated[
    RefineMethod, Field(discriminator="method"), BeforeValidator(_default_method)
]
