"""What manual segments mean: layers, parts of segments, and the stretches between them."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

import numpy as np

from besman.records import LabelledSegments

Side = Literal["right", "left"]
SIDES: tuple[Side, Side] = ("right", "left")

ACTIONS = "actions"
"""Layer of what building blocks make; further levels are called ``actions_2`` and so on."""

LAYERS = (*(f"{side}_hand" for side in SIDES), ACTIONS)
"""Layers that a manual segment may be in; of hands, the building blocks of their arm."""

IDLE = "idle"
"""Class of the stretches between manual segments."""

_PART_SUFFIX = "_part"


def drop_parts(truth: LabelledSegments) -> LabelledSegments:
    """Leave out segments whose label ends in ``_part``: they overlap the one they belong to."""
    whole = [k for k, label in enumerate(truth.labels) if not label.endswith(_PART_SUFFIX)]
    return truth.take(whole)


def is_layer(name: str) -> bool:
    """Tell whether there is such a layer."""
    return name in LAYERS or _holds_actions(name)


def _holds_actions(layer: str) -> bool:
    return re.fullmatch(rf"{ACTIONS}(_\w+)?", layer) is not None


def stack_layers(layers: Mapping[str, LabelledSegments]) -> LabelledSegments:
    """Make one record of the layers of one recording.

    Parameters
    ----------
    layers : mapping of str to LabelledSegments
        At least one, by its name.

    Returns
    -------
    LabelledSegments
        In the order of start and end.
    """
    names = [name for name, layer in layers.items() for _ in layer.labels]
    every = dataclasses.replace(
        next(iter(layers.values())),
        bounds=np.concatenate([layer.bounds for layer in layers.values()]),
        labels=tuple(label for layer in layers.values() for label in layer.labels),
        distances=np.concatenate([layer.distances for layer in layers.values()]),
        layers=tuple(names),
    )
    return every.take(np.lexsort((every.bounds[:, 1], every.bounds[:, 0])))


def building_blocks(truth: LabelledSegments, side: Side = "right") -> LabelledSegments | None:
    """Return the building blocks of one arm.

    Parameters
    ----------
    truth : LabelledSegments
        Manual segments.
    side : "right" or "left"
        The arm.

    Returns
    -------
    LabelledSegments or None
        Without layers, all segments. Else those of the hand's layer, or if that is empty those
        that are in no layer; None if there are no such segments.
    """
    if not truth.layers:
        return truth
    for layer in (f"{side}_hand", ""):
        rows = [row for row, name in enumerate(truth.layers) if name == layer]
        if rows:
            return truth.take(rows)
    return None


def actions_of(truth: LabelledSegments) -> LabelledSegments:
    """Return the segments in layers of actions; all segments if there is no such layer."""
    rows = [row for row, name in enumerate(truth.layers) if _holds_actions(name)]
    return truth.take(rows) if rows else truth


def side_of(markers: Sequence[str]) -> Side:
    """Return the arm that markers are on: the left one if all of them are."""
    on_left = [name.startswith("left_") for name in markers]
    return "left" if on_left and all(on_left) else "right"


def hand_side(truth: Iterable[LabelledSegments]) -> Side | None:
    """Return the arm whose building blocks are labelled in a layer of their own.

    Parameters
    ----------
    truth : iterable of LabelledSegments
        Manual segments.

    Returns
    -------
    "right", "left" or None
        The right arm if both are; None if no hand has a layer.
    """
    there = {layer for one in truth for layer in one.layers}
    return next((side for side in SIDES if f"{side}_hand" in there), None)


def complete_truth(truth: LabelledSegments, n_samples: int, idle_s: float) -> LabelledSegments:
    """Drop parts of segments and give long stretches without a label the class `IDLE`.

    Parameters
    ----------
    truth : LabelledSegments
        Manual segments.
    n_samples : int
        Length of the recording.
    idle_s : float
        Stretches without a label that are longer than this, in seconds, become segments.

    Returns
    -------
    LabelledSegments
        Whole segments in order of time.
    """
    whole = drop_parts(truth)
    rows = sorted(
        (int(start), int(end), label)
        for (start, end), label in zip(whole.bounds, whole.labels, strict=True)
    )
    idle: list[tuple[int, int, str]] = []
    reached = 0
    for start, end, _ in [*rows, (n_samples, n_samples, "")]:
        if start - reached > idle_s * truth.rate_hz:
            idle.append((reached, start, IDLE))
        reached = max(reached, end)
    rows = sorted(rows + idle)
    return dataclasses.replace(
        truth,
        bounds=np.array([row[:2] for row in rows], dtype=np.int64).reshape(-1, 2),
        labels=tuple(row[2] for row in rows),
        distances=np.zeros(len(rows)),
        layers=(),
    )
