"""The segmentation methods there are, by name; a new one is a module of this folder and its entry.

Nothing is imported before a method is used, so that help texts can name them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from besman.stages.segment.hand_segmentation import SegmentingStage


@dataclass(frozen=True)
class SegmentationKind:
    """A segmentation method: one entry of `SEGMENTATIONS`.

    Attributes
    ----------
    name : str
        As in YAML and on the command line.
    config : str
        Its stage, ``module:Class`` of this folder.
    about : str
        What it is.
    """

    name: str
    config: str
    about: str

    def load(self) -> type[SegmentingStage]:
        """Return its stage."""
        config: type[SegmentingStage] = resolve_name(f"{__package__}.{self.config}")
        return config


SEGMENTATIONS = (
    SegmentationKind(
        "valley_vmci",
        "stage:ValleyVmciConfig",
        "vMCI's evidence over the valleys of the speed, with rests; nothing to tune",
    ),
    SegmentationKind(
        "vmci", "stage:SegmentConfig", "exact vMCI, with the probability of every border"
    ),
    SegmentationKind("vmci_online", "stage:VmciOnlineConfig", "vMCI sample by sample"),
    SegmentationKind("valley_online", "stage:ValleyOnlineConfig", "valley_vmci sample by sample"),
    SegmentationKind("mci", "rivals:MciConfig", "multiple change-point inference without speed"),
    SegmentationKind("locmin", "rivals:LocminConfig", "local minima of the speed"),
    SegmentationKind(
        "bp_ar_hmm", "rivals:BpArHmmConfig", "beta process autoregressive hidden Markov model"
    ),
    SegmentationKind("probs", "rivals:ProbsConfig", "probabilistic segmentation into primitives"),
)
"""All methods; the first one is taken where none is named."""

SEGMENTATION_NAMES = tuple(entry.name for entry in SEGMENTATIONS)
