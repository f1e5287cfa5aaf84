"""The classes that a recipe can find, and whether those that it selects are among them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from besman.exceptions import ConfigError, RecognitionError, nearest
from besman.pipeline.config import PipelineConfig
from besman.records.layers import complete_truth, side_of
from besman.stages.compose.stage import leave_out_actions
from besman.stages.read.read_inputs import Inputs
from besman.stages.recognize.model_files import load_model
from besman.stages.recognize.one_throw import OneThrowConfig


def count_model(config: PipelineConfig) -> Counter[str]:
    """Count the classes of a trained model; refuse a class to select that is none of them.

    Raises
    ------
    ConfigError
        Saying which class it is, and which there are.
    """
    model = str(config.recognize.model)
    counts = Counter(load_model(Path(model)).labels)
    _check_wanted(config, counts, f"is no class of {model}")
    return counts


def count_examples(config: PipelineConfig, inputs: Inputs) -> Counter[str]:
    """Count the labelled examples; refuse a class to select that is learnt here and has none.

    Raises
    ------
    RecognitionError
        If there are none at all.
    ConfigError
        Saying which class it is, and which there are.
    """
    counts, recognize = Counter[str](), config.recognize
    truth = inputs.truth
    if config.select.label is not None:
        truth = leave_out_actions(truth, config.compose, side_of(config.segment.markers))
    for recording, manual in zip(inputs.recordings, truth, strict=True):
        if manual is not None and not isinstance(recognize, OneThrowConfig):
            manual = complete_truth(manual, len(recording.time), recognize.idle_s)
        counts.update(() if manual is None else manual.labels)
    if not counts:
        raise RecognitionError(
            f"recognize: no labelled examples: none of {len(inputs.recordings)} recordings has a "
            "segments file beside it (STEM_manually_segmented.json): besman annotate RECORDING "
            "makes one, of one take at least; or name recordings that have with training:"
        )
    if recognize.learns:
        _check_wanted(config, counts, "has no labelled example")
    return counts


def _check_wanted(config: PipelineConfig, counts: Mapping[str, int], problem: str) -> None:
    """Refuse a class to select of which nothing is known, or an action with such a block."""
    for action, blocks in config.select.actions.items():
        for label in blocks:
            if label not in counts:
                raise ConfigError(
                    f"select.actions.{action}: got {label!r}, which {problem}; "
                    f"{nearest(label, counts)}"
                )
    for wanted in config.select.wanted:
        if wanted in config.select.actions or wanted in counts:
            continue
        key = "label" if config.select.label else "action"
        raise ConfigError(
            f"select.{key}: got {wanted!r}, which {problem}; {nearest(wanted, counts)}"
        )


def list_counts(counts: Mapping[str, int]) -> str:
    """Return classes with how many there are of each, in the order of their names."""
    return ", ".join(f"{label} {count}" for label, count in sorted(counts.items()))
