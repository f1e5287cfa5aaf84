"""Trained models as files: an ``.npz`` without pickle, and JSON that says what is in it."""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import Any

from besman.exceptions import RecognitionError, RunError
from besman.foreign.json_text import parse_json
from besman.io.atomic_files import check_folder, make_folder, write_text, written_aside
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
    check_model_place(path)
    arrays, about = _places(path)
    make_folder(arrays.parent, kind=RecognitionError)
    with written_aside(arrays, kind=RecognitionError) as temporary:
        save_record(model, temporary)
    try:
        content = {**describe_model(model), "sha256": _checksum(arrays)}
        write_text(about, json.dumps(content, indent=2) + "\n", kind=RecognitionError)
    except RecognitionError:
        arrays.unlink(missing_ok=True)
        raise
    return arrays, about


def check_model_place(path: Path) -> None:
    """See before the work that a model can be written after it.

    Raises
    ------
    BesmanError
        If one of its files is there already, or its folder may not be written.
    """
    for file in _places(path):
        if file.exists():
            raise RecognitionError(f"{file}: is there already and is not overwritten")
    check_folder(path.parent, f"{path}", RecognitionError)


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
    checksum = _checksum(arrays)
    if checksum != content.get("sha256"):
        raise RecognitionError(f"{arrays}: is damaged or not the one that {about.name} describes")
    model = _read_arrays(arrays, checksum)
    for key, value in json.loads(json.dumps(describe_model(model))).items():
        # What an older besman did not write is not missed.
        if content.get(key, value) != value:
            raise RecognitionError(
                f"{about}: {key}: got {content[key]!r:.80}, which is not what {arrays.name} holds: "
                f"{value!r:.80}"
            )
    return model


# A run asks for a model to know its classes, and later to use it.
@lru_cache(maxsize=2)
def _read_arrays(path: Path, checksum: str) -> RecognitionModel:
    """Read the model that a file with a checksum holds; the same content is read once."""
    try:
        model = load_record(path, _MOST_BYTES)
    except RunError as error:
        raise RecognitionError(str(error)) from None
    if not isinstance(model, RecognitionModel):
        raise RecognitionError(f"{path}: holds a {type(model).__name__}; expected a model")
    try:
        check_model(model)
    except RecognitionError as error:
        raise RecognitionError(f"{path}: {error}") from None
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
