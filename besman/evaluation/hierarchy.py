"""The experiments of thesis chapters 6 and 8: building blocks and actions, found and named."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.evaluation.block_names import METHODS, Method, name_blocks, train
from besman.evaluation.demonstrations import (
    Demonstration,
    arm_markers,
    cut_demonstrations,
    name_markers,
    sample_labels,
)
from besman.exceptions import ConfigError, RecognitionError, nearest
from besman.records import LabelledSegments, Segments
from besman.records.layers import IDLE
from besman.stages.compose.actions import LevelModel, compose_level
from besman.stages.compose.borders import candidate_borders
from besman.stages.segment.scores import match_borders
from besman.stages.segment.stage import SegmentConfig

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Experiment:
    """How a dataset is used.

    Attributes
    ----------
    actions_each : int
        Actions of one demonstration.
    examples : int
        Demonstrations to learn from.
    around_s : float
        Seconds kept before and after a demonstration.
    thesis : dict of tuple
        For each method: F1 and accuracy of building blocks, F1 and accuracy of actions.
    """

    actions_each: int
    examples: int
    around_s: float
    thesis: dict[str, tuple[float, float, float, float]]


EXPERIMENTS = {
    "step": Experiment(
        2,
        4,
        0.0,
        {
            "vhms": (0.85, 0.79, 0.77, 0.97),
            "cl_vhms_g_means": (0.85, 0.72, 0.77, 0.97),
            "cl_vhms_k_means": (0.85, 0.75, 0.77, 0.97),
        },
    ),
    "object_rotation": Experiment(
        4,
        8,
        0.5,
        {
            "vhms": (0.74, 0.62, 0.72, 0.80),
            "cl_vhms_g_means": (0.74, 0.70, 0.72, 0.80),
            "cl_vhms_k_means": (0.74, 0.65, 0.72, 0.80),
        },
    ),
    "circle_drawing": Experiment(4, 2, 0.5, {}),
    "rotation": Experiment(2, 2, 0.5, {}),
}
"""Datasets of tables 6.1 and 6.2 and of section 8.2."""

CLUSTER_DRAWS = 3
"""Clusters take many times longer than labels."""

MARGIN_S = 0.2
"""Greatest distance of a border that counts as found, seconds (thesis 6.3)."""


@dataclass(frozen=True)
class HierarchyScore:
    """Means over demonstrations.

    Attributes
    ----------
    n : int
        Demonstrations.
    block_f1, block_accuracy : float
        Of the borders of building blocks (true and false positives of both hands summed), and
        share of samples with the right block.
    f1, accuracy : float
        The same of the actions.
    tp, fp : float
        Borders of actions found rightly and wrongly, a demonstration.
    seconds : float
        To compose one demonstration, without the segmentation.
    """

    n: int
    block_f1: float
    block_accuracy: float
    f1: float
    accuracy: float
    tp: float
    fp: float
    seconds: float


def simulate_demonstrations(name: str, seed: int = 0) -> list[Demonstration]:
    """Simulate a dataset and cut it into demonstrations (synthetic).

    Parameters
    ----------
    name : str
        One of `EXPERIMENTS`.
    seed : int
        Another seed, other people.

    Raises
    ------
    ConfigError
        If there is no such experiment.
    """
    from besman.synthetic.datasets import captures

    plan = _find(name)
    found: list[Demonstration] = []
    for capture in captures(name, seed=seed):
        recording = name_markers(capture.recording)
        blocks = {key.removesuffix("_hand"): layer for key, layer in capture.layers.items()}
        found += cut_demonstrations(
            recording, capture.segments, blocks, plan.actions_each, plan.around_s
        )
    return found


def _find(name: str) -> Experiment:
    """Return an experiment by its name."""
    if name not in EXPERIMENTS:
        raise ConfigError(f"evaluate hierarchy: no dataset {name!r}; {nearest(name, EXPERIMENTS)}")
    return EXPERIMENTS[name]


def run_experiment(
    name: str,
    demonstrations: Sequence[Demonstration] | None = None,
    draws: int = 10,
    progress: Callable[[float], None] = lambda done: None,
) -> list[dict[str, Any]]:
    """Run one experiment: blocks only as in the thesis, its clusters, and valleys added.

    Parameters
    ----------
    name : str
        One of `EXPERIMENTS`.
    demonstrations : sequence of Demonstration, optional
        Simulated if not given.
    draws : int
        Draws of the demonstrations to learn from.
    progress : callable
        Gets the share done.

    Returns
    -------
    list of dict
        Rows for ``evaluate --json``: dataset, source, method, the means of `HierarchyScore` over
        the draws, and the thesis' figures (on its own recordings).
    """
    plan = _find(name)
    if demonstrations is None:
        demonstrations = simulate_demonstrations(name)
    found = [find_blocks(one) for one in demonstrations]
    rows = []
    variants = [*((method, False) for method in METHODS), ("vhms", True)]
    for number, (method, valleys) in enumerate(variants):
        scores = [
            evaluate(demonstrations, found, plan.examples, method, seed, valleys=valleys)
            for seed in range(draws if method == "vhms" else min(draws, CLUSTER_DRAWS))
        ]
        means = {
            field.name: float(np.mean([getattr(score, field.name) for score in scores]))
            for field in dataclasses.fields(HierarchyScore)
        }
        seconds = means.pop("seconds")
        rows.append(
            {
                "dataset": name,
                "source": "synthetic",
                "method": f"{method}_valleys" if valleys else method,
                **means,
                "examples_per_class": plan.examples,
                "margin_s": MARGIN_S,
                "seconds_per_recording": seconds,
                "thesis": plan.thesis.get(method),
            }
        )
        progress((number + 1) / len(variants))
    return rows


def hierarchy_table(rows: Sequence[dict[str, Any]]) -> Any:
    """Return rows of `run_experiment` as a table, the thesis' figures in brackets."""
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(
        title="building blocks and actions (synthetic)",
        caption="in brackets: the thesis, on its own recordings; margin 0.2 s; _valleys: actions "
        "may begin where a hand is slow, too",
        box=SIMPLE,
    )
    for name in ("dataset", "method"):
        table.add_column(name, no_wrap=True)
    names = ("block_f1", "block_accuracy", "f1", "accuracy")
    for name in (*names, "tp", "fp", "each"):
        table.add_column(name.replace("_", " "), justify="right", no_wrap=True)
    for row in rows:
        beside = row["thesis"] or (None,) * len(names)
        figures = [
            f"{row[name]:.2f}" + ("" if one is None else f" ({one:.2f})")
            for name, one in zip(names, beside, strict=True)
        ]
        counts = [f"{row['tp']:.1f}", f"{row['fp']:.1f}"]
        each = f"{1000 * row['seconds_per_recording']:.1f} ms"
        table.add_row(row["dataset"], row["method"], *figures, *counts, each)
    return table


def find_blocks(demonstration: Demonstration, stage: Any = None) -> dict[str, Segments]:
    """Segment each arm's movement on its own, as thesis 6.3.2 does.

    Parameters
    ----------
    demonstration : Demonstration
    stage : Stage, optional
        A segmentation stage with `markers`; exact vMCI at 30 Hz by default.
    """
    stage = SegmentConfig(rate_hz=30.0) if stage is None else stage
    recording = demonstration.recording
    return {
        arm: stage.model_copy(update={"markers": names[:1]}).run((recording,))[0]
        for arm, names in arm_markers(recording.markers).items()
        if arm in demonstration.blocks
    }


def evaluate(
    demonstrations: Sequence[Demonstration],
    found: Sequence[dict[str, Segments]],
    examples: int,
    method: Method = "vhms",
    seed: int = 0,
    margin_s: float = MARGIN_S,
    valleys: bool = True,
) -> HierarchyScore:
    """Learn from some demonstrations, compose the others and score them.

    Parameters
    ----------
    demonstrations : sequence of Demonstration
    found : sequence of dict
        Building blocks of each arm of each demonstration; see `find_blocks`.
    examples : int
        Demonstrations to learn from, drawn by chance.
    method : str
        One of `METHODS`; the variants with clusters name no blocks but group those of as many
        demonstrations as were learnt from, and are scored under the best assignment of clusters to
        classes.
    seed : int
        Of the draw and of the clusters.
    margin_s : float
        Greatest distance of a border that counts as found, seconds.
    valleys : bool
        Actions may begin where a hand is slow too, not only at the borders of blocks.

    Returns
    -------
    HierarchyScore

    Raises
    ------
    RecognitionError
        If there are not more demonstrations than examples.
    """
    if examples >= len(demonstrations):
        raise RecognitionError(
            f"got {len(demonstrations)} demonstrations; expected more than the {examples} to "
            "learn from"
        )
    order = np.random.default_rng(seed).permutation(len(demonstrations))
    learnt = [demonstrations[row] for row in sorted(order[:examples])]
    rows = sorted(order[examples:])
    block_models, action_model = train(learnt)
    batches = [rows[first : first + examples] for first in range(0, len(rows), examples)]
    scores = []
    for batch in batches:
        tests = [(demonstrations[row], found[row]) for row in batch]
        named = name_blocks(tests, block_models, method, seed)
        scores += [
            _score(demonstration, blocks, labels, action_model, margin_s, valleys)
            for (demonstration, blocks), labels in zip(tests, named, strict=True)
        ]
    mean = [float(value) for value in np.mean(scores, axis=0)]
    return HierarchyScore(len(rows), *mean)


def _score(
    demonstration: Demonstration,
    blocks: dict[str, Segments],
    labels: dict[str, tuple[str, ...]],
    model: LevelModel,
    margin_s: float,
    valleys: bool,
) -> tuple[float, ...]:
    """Compose one demonstration; return the figures of `HierarchyScore` but the last."""
    recording = demonstration.recording
    start = time.perf_counter()
    markers = arm_markers(recording.markers)
    hands = [markers[arm][0] for arm in blocks] if valleys else []
    borders = candidate_borders(recording, [one.bounds for one in blocks.values()], hands)
    level = compose_level(recording, borders, model)
    seconds = time.perf_counter() - start
    actions = join_idle(level.borders, level.labels, recording)
    counts = np.array(
        [_count(blocks[arm].bounds, demonstration.blocks[arm], margin_s) for arm in blocks]
    ).sum(axis=0)
    block_accuracy = np.mean(
        [
            _agreement(blocks[arm].bounds, labels[arm], demonstration.blocks[arm], recording)
            for arm in blocks
        ]
    )
    tp, fp, fn = _count(actions.bounds, demonstration.actions, margin_s)
    accuracy = _agreement(actions.bounds, actions.labels, demonstration.actions, recording)
    return (_f1(*counts), float(block_accuracy), _f1(tp, fp, fn), accuracy, tp, fp, seconds)


def join_idle(borders: npt.ArrayLike, labels: Sequence[str], recording: Any) -> LabelledSegments:
    """Make segments of actions; pauses that follow each other are one pause."""
    rows = np.asarray(borders, dtype=np.int64)
    kept = [
        index
        for index in range(len(labels))
        if index == 0 or not labels[index] == labels[index - 1] == IDLE
    ]
    starts = rows[kept]
    return LabelledSegments(
        np.stack([starts, np.append(starts[1:], rows[-1])], axis=1),
        tuple(labels[index] for index in kept),
        np.zeros(len(kept)),
        recording.rate_hz,
        recording.source,
        recording.first_frame,
    )


def _count(
    bounds: npt.NDArray[np.int64], truth: LabelledSegments, margin_s: float
) -> tuple[int, int, int]:
    """Return true positives, false positives and misses of the inner borders."""
    ends = (0, int(bounds[-1, 1]))
    found, true = (
        np.unique(one)[(np.unique(one) > ends[0]) & (np.unique(one) < ends[1] - 1)]
        for one in (bounds, truth.bounds)
    )
    true = true[np.diff(true, prepend=-np.inf) > 2]
    n_pairs = len(match_borders(found / truth.rate_hz, true / truth.rate_hz, margin_s))
    return n_pairs, len(found) - n_pairs, len(true) - n_pairs


def _f1(tp: float, fp: float, fn: float) -> float:
    return float(2 * tp / (2 * tp + fp + fn)) if tp + fp + fn else 1.0


def _agreement(
    bounds: npt.NDArray[np.int64], labels: Sequence[str], truth: LabelledSegments, recording: Any
) -> float:
    """Share of samples with the right label."""
    n_samples = len(recording.time)
    found = sample_labels(bounds, labels, n_samples)
    true = sample_labels(truth.bounds, truth.labels, n_samples)
    return float(np.mean([one == two for one, two in zip(found, true, strict=True)]))
