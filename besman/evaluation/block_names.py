"""Names of building blocks: learnt from examples, or clusters under their best assignment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from besman.classifiers.nearest_neighbour import scale
from besman.evaluation.demonstrations import Demonstration, arm_markers, sample_labels
from besman.records import Segments
from besman.records.layers import IDLE
from besman.stages.compose.actions import LevelModel, cut_paths, name_spans, train_level
from besman.stages.compose.clustering import cluster_g_means, cluster_k_means, match_clusters

Method = Literal["vhms", "cl_vhms_k_means", "cl_vhms_g_means"]
METHODS: tuple[Method, ...] = ("vhms", "cl_vhms_k_means", "cl_vhms_g_means")


def train(learnt: Sequence[Demonstration]) -> tuple[dict[str, LevelModel], LevelModel]:
    """Learn the building blocks of each arm, and the actions of all arms together."""
    recordings = [one.recording for one in learnt]
    arms = arm_markers(recordings[0].markers)
    block_models = {
        arm: train_level(
            recordings,
            [one.blocks[arm].bounds for one in learnt],
            [one.blocks[arm].labels for one in learnt],
            names,
        )
        for arm, names in arms.items()
        if arm in learnt[0].blocks
    }
    action_model = train_level(
        recordings,
        [one.actions.bounds for one in learnt],
        [one.actions.labels for one in learnt],
        [name for arm in block_models for name in arms[arm]],
    )
    return block_models, action_model


def name_blocks(
    tests: Sequence[tuple[Demonstration, dict[str, Segments]]],
    models: dict[str, LevelModel],
    method: Method,
    seed: int,
) -> list[dict[str, tuple[str, ...]]]:
    """Name the blocks of each arm of each demonstration."""
    if method == "vhms":
        return [
            {
                arm: name_spans(one.recording, blocks[arm].bounds, model)[0]
                for arm, model in models.items()
            }
            for one, blocks in tests
        ]
    named: list[dict[str, tuple[str, ...]]] = [{} for _ in tests]
    for arm, model in models.items():
        paths = [
            cut_paths(one.recording, blocks[arm].bounds, model.markers, model.n_points)
            for one, blocks in tests
        ]
        # What the hand does, not where: the same movement elsewhere is the same block.
        values = np.concatenate([path - path[:, :1] for path in paths])
        # Nothing was learnt here: the range is that of the blocks themselves.
        low = values.min(axis=(0, 1))
        span = np.full(len(low), max(float(np.ptp(values, axis=(0, 1)).max()), 1e-9))
        vectors = scale(values, low, span)
        if method == "cl_vhms_g_means":
            clusters = cluster_g_means(vectors, seed)
        else:
            # One more than the expected classes, for what fits none of them.
            expected = len(set(model.labels) - {IDLE}) + 1
            clusters = cluster_k_means(vectors, min(expected, len(vectors)), seed)
        parts = np.split(clusters, np.cumsum([len(part) for part in paths])[:-1])
        for number, labels in enumerate(_assign(tests, arm, parts)):
            named[number][arm] = labels
    return named


def _assign(
    tests: Sequence[tuple[Demonstration, dict[str, Segments]]],
    arm: str,
    clusters: Sequence[npt.NDArray[np.int64]],
) -> list[tuple[str, ...]]:
    """Name clusters so that as many samples as possible are right; those left over are idle."""
    by_sample: list[int] = []
    truth: list[str] = []
    for (one, blocks), numbers in zip(tests, clusters, strict=True):
        n_samples = len(one.recording.time)
        by_sample += [
            int(name)
            for name in sample_labels(blocks[arm].bounds, [str(k) for k in numbers], n_samples)
        ]
        truth += sample_labels(one.blocks[arm].bounds, one.blocks[arm].labels, n_samples)
    classes = match_clusters(by_sample, truth)
    return [tuple(classes.get(int(k), IDLE) for k in numbers) for numbers in clusters]
