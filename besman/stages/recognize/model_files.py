"""Trained models as files: an ``.npz`` without pickle, and JSON that says what is in it."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from besman.exceptions import RecognitionError, RunError
from besman.foreign.json_text import parse_json
from besman.records.files import load_record, save_record
from besman.stages.recognize.model import RecognitionModel
from besman.stages.recognize.model_check import check_model

_FORMAT = "besman recognition model 1"
# Arrays of fifty thousand examples: who shares a model shares no more.
_MOST_BYTES = 256_000_000


def save_model(model: RecognitionModel, path: Path) -> tuple[Path, Path]:
    """Write a model; the same model gives the same bytes.

    Parameters
    ----------
    model : RecognitionModel
    path : Path
        ``NAME.npz``, or ``NAME`` alone; ``NAME.json`` is written beside it.

    Returns
    -------
    pair of Path
        The ``.npz`` and the ``.json``.

    Raises
    ------
    RecognitionError
        If one of the files is there already or cannot be written.
    """
    arrays, about = _places(path)
    for file in (arrays, about):
        if file.exists():
            raise RecognitionError(f"{file}: is there already and is not overwritten")
    try:
        arrays.parent.mkdir(parents=True, exist_ok=True)
        save_record(model, arrays)
        content = {**describe_model(model), "sha256": _checksum(arrays)}
        about.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise RecognitionError(f"{arrays}: cannot be written: {error.strerror}") from None
    return arrays, about


def load_model(path: Path) -> RecognitionModel:
    """Read what `save_model` wrote.

    Parameters
    ----------
    path : Path
        The ``.npz``, the ``.json``, or their name without ending.

    Raises
    ------
    RecognitionError
        If a file is missing or damaged, or the two do not belong together.
    """
    arrays, about = _places(path)
    try:
        content = parse_json(about.read_bytes())
    except OSError as error:
        raise RecognitionError(f"{about}: cannot be read: {error.strerror}") from None
    except ValueError:
        raise RecognitionError(f"{about}: is not JSON; expected a model of besman train") from None
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise RecognitionError(f"{about}: is no model; expected format {_FORMAT!r}")
    if not arrays.is_file():
        raise RecognitionError(f"{arrays}: no such file; it belongs beside {about.name}")
    if _checksum(arrays) != content.get("sha256"):
        raise RecognitionError(f"{arrays}: is damaged or not the one that {about.name} describes")
    try:
        model = load_record(arrays, _MOST_BYTES)
    except RunError as error:
        raise RecognitionError(str(error)) from None
    if not isinstance(model, RecognitionModel):
        raise RecognitionError(f"{arrays}: holds a {type(model).__name__}; expected a model")
    try:
        check_model(model)
    except RecognitionError as error:
        raise RecognitionError(f"{arrays}: {error}") from None
    for key, value in json.loads(json.dumps(describe_model(model))).items():
        # What an older besman did not write is not missed.
        if content.get(key, value) != value:
            raise RecognitionError(
                f"{about}: {key}: got {content[key]!r:.80}, which is not what {arrays.name} holds: "
                f"{value!r:.80}"
            )
    return model


def describe_model(model: RecognitionModel) -> dict[str, Any]:
    """Return what a person wants to know of a model, for JSON."""
    return {
        "format": _FORMAT,
        "method": model.method,
        "settings": model.settings,
        "classes": {name: model.labels.count(name) for name in model.classes},
        "features": list(model.recipe.features),
        "markers": list(model.recipe.markers),
        "objects": list(model.recipe.objects),
        "n_points": model.recipe.n_points,
        "recordings": sorted(set(model.sources)),
        "data_sha256": model.data_sha256,
    }


def _places(path: Path) -> tuple[Path, Path]:
    if path.suffix in (".npz", ".json"):
        path = path.with_suffix("")
    return path.with_name(path.name + ".npz"), path.with_name(path.name + ".json")


def _checksum(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
