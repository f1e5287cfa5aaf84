"""What a run learns from: labelled examples, another run's model, or a file's."""

from __future__ import annotations

from pathlib import Path

from besman.person.marker_set import load_marker_set
from besman.pipeline.config import PipelineConfig, learn_from, needs_no_examples
from besman.pipeline.finished_run import trained_model
from besman.pipeline.known_classes import count_examples, count_model
from besman.pipeline.run_folder import Run
from besman.records import LabelledRecording, LabelledSegments
from besman.records.layers import side_of
from besman.stages.compose.actions import LevelModel
from besman.stages.compose.stage import leave_out_actions
from besman.stages.read.read_inputs import Inputs, read_inputs
from besman.stages.recognize.model import RecognitionModel
from besman.stages.recognize.model_files import load_model
from besman.stages.recognize.stage import RecognizeMethod

LabelledTakes = tuple[tuple[LabelledRecording, ...], tuple[LabelledSegments, ...]]
"""Recordings, and the manual segments of those that have some."""


def read_examples(config: PipelineConfig, inputs: Inputs, trained_in: Path | None) -> Inputs | None:
    """Return the recordings to learn from, if there is anything to learn.

    A class to select that is not known is refused.
    """
    if config.recognize.model is not None:
        count_model(config)
    if trained_in is not None or needs_no_examples(config):
        return None
    if config.training:
        inputs = read_inputs(config.training, learn_from(config), config.read)
    count_examples(config, inputs)
    return inputs


def find_examples(
    config: PipelineConfig,
    run: Run,
    inputs: Inputs,
    taught: Inputs | None,
    labelled: tuple[LabelledRecording, ...],
) -> LabelledTakes:
    """Return what can be learnt from; nothing where all that is to be learnt is known."""
    if taught is None:
        return (), ()
    if config.training:
        markers = load_marker_set(config.label.markers)
        known = (taught.recordings, markers, taught.teacher)
        labelled = run.prepare("label_training", config.label, *known)
    else:
        # Those that are usable; none of them may have examples.
        taught = inputs
        count_examples(config, inputs)
    return labelled, tuple(segments for segments in taught.truth if segments is not None)


def learn_names(
    config: PipelineConfig,
    recognize: RecognizeMethod,
    run: Run,
    examples: LabelledTakes,
    trained_in: Path | None,
) -> RecognitionModel:
    """Return the trained model: a file's, another run's, or one of the labelled examples."""
    if recognize.model is not None:
        return load_model(Path(recognize.model))
    if trained_in is not None:
        model: RecognitionModel = trained_model(trained_in)
        return model
    labelled, manual = examples
    blocks = leave_out_actions(manual, config.compose, side_of(config.segment.markers))
    known = tuple(one for one in blocks if one is not None)
    return run.prepare("train", recognize.training, labelled, known)


def learn_levels(
    config: PipelineConfig, run: Run, examples: LabelledTakes, trained_in: Path | None
) -> tuple[LevelModel, ...]:
    """Return the actions of every level: another run's, or those of the labelled examples."""
    if trained_in is not None:
        levels: tuple[LevelModel, ...] = trained_model(trained_in, "train_actions")
        return levels
    assert config.compose is not None
    return run.prepare("train_actions", config.compose.training, *examples)
