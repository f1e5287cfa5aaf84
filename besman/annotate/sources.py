"""What the command line names: labels and trained models."""

from __future__ import annotations

from pathlib import Path

from besman.exceptions import AnnotationError
from besman.stages.recognize.model import RecognitionModel
from besman.stages.recognize.model_files import load_model


def split_labels(text: str | None) -> tuple[str, ...]:
    """Return the labels of ``--labels``, separated by commas.

    Raises
    ------
    AnnotationError
        If one is empty.
    """
    if text is None:
        return ()
    labels = tuple(label.strip() for label in text.split(","))
    if not all(labels):
        raise AnnotationError(f"--labels: got {text!r}, expected names separated by commas")
    return labels


def load_models(run: Path | None, model: Path | None) -> tuple[RecognitionModel, ...]:
    """Load the trained models of a run and of a file.

    Raises
    ------
    BesmanError
        If one is missing or damaged.
    """
    models = () if model is None else (load_model(model),)
    if run is not None:
        from besman.pipeline.finished_run import trained_model

        models += (trained_model(run),)
    return models
