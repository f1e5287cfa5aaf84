"""The pipeline's step from building blocks to actions."""

from __future__ import annotations

from typing import Any

from besman.pipeline.run_folder import Run
from besman.records import LabelledRecording, LabelledSegments
from besman.stages.compose.stage import ComposeConfig, compose_results, pick_level


def run_compose(
    config: ComposeConfig,
    run: Run,
    found: tuple[tuple[LabelledRecording, ...], tuple[LabelledSegments, ...]],
    examples: tuple[tuple[LabelledRecording, ...], tuple[LabelledSegments, ...]] | None,
    models: Any,
    action: str | None,
) -> tuple[LabelledSegments, ...]:
    """Learn actions, if no models are given, and find them.

    Parameters
    ----------
    config : ComposeConfig
        The stage.
    run : Run
    found : tuple of recordings and their building blocks
    examples : tuple of recordings and their manual segments, or None
        To learn from.
    models : tuple of LevelModel or None
        What another run learnt.
    action : str, optional
        What is selected later.

    Returns
    -------
    tuple of LabelledSegments
        The level of the action, or the building blocks if none is selected.
    """
    recordings, blocks = found
    if models is None:
        assert examples is not None
        n = config.examples_per_class
        models = run.step(
            "train_actions", config, *examples, items=n, unit="a class", method="train"
        )
    n = sum(len(one.bounds) for one in blocks)
    actions = run.step("compose", config, recordings, blocks, models, items=n, unit="blocks")
    run.results["compose"] = compose_results(actions)
    return blocks if action is None else pick_level(actions, config, action)
