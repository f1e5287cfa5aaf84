"""The composition stage: building blocks make actions."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator

from besman.classifiers.draw_examples import draw_examples
from besman.config.stage import Items, Stage, Training, Truth, Work
from besman.exceptions import RecognitionError, nearest
from besman.records import Actions, LabelledRecording, LabelledSegments, Segments
from besman.records.layers import IDLE, Side, actions_of, building_blocks, complete_truth
from besman.stages.compose.actions import LevelModel, compose_levels, train_level
from besman.stages.compose.borders import candidate_borders

# Stretches without an action that are longer than this are ``idle``, seconds.
_IDLE_S = 0.25


class ComposeConfig(Stage):
    """Velocity-based hierarchical movement segmentation, exact.

    Attributes
    ----------
    levels : tuple of tuples of str
        Classes of the actions of each level, the lowest first. Their examples are manual segments
        with these labels in layer ``actions``, or, in a file without layers, segments that overlap
        those of the building blocks. ``idle`` stands for the stretches between them.
    examples_per_class : int
        Labelled actions of each class to learn from; of a class with fewer, all are taken.
    seed : int
        Seed of the draw of examples.
    markers : tuple of str
        Markers whose paths are looked at; of both arms for actions of both.
    hands : tuple of str
        Where one of these is slow an action may begin or end too, not only at the borders of
        blocks; none to have whole blocks only, as in the thesis.
    n_points : int
        Points that every path is interpolated to.
    longest_blocks : int, optional
        Most blocks, or stretches between such places, in one action.
    """

    method: Literal["vhms"] = "vhms"
    levels: Annotated[
        tuple[Annotated[tuple[str, ...], Field(min_length=1)], ...], Field(min_length=1)
    ]
    examples_per_class: int = Field(default=4, ge=1)
    seed: int = Field(default=0, ge=0)
    markers: Annotated[tuple[str, ...], Field(min_length=1)] = ("hand_top", "elbow", "shoulder")
    hands: tuple[str, ...] = ("hand_top",)
    n_points: int = Field(default=25, ge=2)
    longest_blocks: int | None = Field(default=None, ge=1)

    @field_validator("levels")
    @classmethod
    def _check_levels(cls, levels: tuple[tuple[str, ...], ...]) -> tuple[tuple[str, ...], ...]:
        names = [name for level in levels for name in level]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"action {twice[0]!r} is listed twice; expected each in one level")
        return levels

    @property
    def actions(self) -> tuple[str, ...]:
        """Classes of the actions of all levels."""
        return tuple(name for level in self.levels for name in level)

    def check_action(self, name: str) -> None:
        """Refuse an action that no level has.

        Raises
        ------
        RecognitionError
            With the actions there are.
        """
        if name not in self.actions:
            raise RecognitionError(f"select: no action {name!r}; {nearest(name, self.actions)}")

    @property
    def training(self) -> Training[tuple[LevelModel, ...]]:
        """Learning, as a step of its own."""
        return Training(self, self.train, self.examples_per_class)

    def items(
        self,
        recordings: tuple[LabelledRecording, ...],
        blocks: tuple[Segments | LabelledSegments, ...],
        models: tuple[LevelModel, ...],
    ) -> Items:
        """Count the building blocks."""
        return Items(sum(len(found.bounds) for found in blocks), "blocks")

    def figures(self, actions: tuple[Actions, ...], truth: Truth, *records: Any) -> dict[str, Any]:
        """Return counts by action and fitness; see `compose_results`."""
        return compose_results(actions)

    def train(
        self,
        recordings: tuple[LabelledRecording, ...],
        truth: tuple[LabelledSegments, ...],
        work: Work = Work(),
    ) -> tuple[LevelModel, ...]:
        """Learn the actions of every level from manual segments.

        Parameters
        ----------
        recordings : tuple of LabelledRecording
        truth : tuple of LabelledSegments
            Manual segments of some of the recordings, matched by source.
        work : Work

        Returns
        -------
        tuple of LevelModel

        Raises
        ------
        RecognitionError
            If an action has no examples, or a path cannot be cut.
        """
        by_source = {recording.source: recording for recording in recordings}
        candidates = []
        for manual in truth:
            if manual.source not in by_source:
                raise RecognitionError(
                    f"manual segments of {manual.source!r} have no recording; "
                    f"{nearest(manual.source, by_source)}"
                )
            recording = by_source[manual.source]
            actions = actions_of(manual)
            if IDLE in self.actions:
                actions = complete_truth(actions, len(recording.time), _IDLE_S)
            candidates += [
                (recording, bounds, label)
                for bounds, label in zip(actions.bounds, actions.labels, strict=True)
            ]
        labels = [label for _, _, label in candidates]
        models = []
        for index, level in enumerate(self.levels):
            chosen = [
                candidates[row]
                for row in draw_examples(labels, self.examples_per_class, self.seed, level)
            ]
            models.append(
                train_level(
                    [recording for recording, _, _ in chosen],
                    [bounds for _, bounds, _ in chosen],
                    [[label] for _, _, label in chosen],
                    self.markers,
                    self.n_points,
                )
            )
            work.progress((index + 1) / len(self.levels))
        return tuple(models)

    def run(
        self,
        recordings: tuple[LabelledRecording, ...],
        blocks: tuple[Segments | LabelledSegments, ...],
        models: tuple[LevelModel, ...],
        work: Work = Work(),
    ) -> tuple[Actions, ...]:
        """Group the building blocks of each recording to actions.

        Parameters
        ----------
        recordings : tuple of LabelledRecording
        blocks : tuple of Segments or LabelledSegments
            Blocks of each recording, of one arm or of both, in the same order.
        models : tuple of LevelModel
            What `train` learnt.
        work : Work

        Returns
        -------
        tuple of Actions
            One for each recording.

        Raises
        ------
        RecognitionError
            If a recording has no blocks, or a path cannot be cut.
        """
        results = []
        for done, (recording, found) in enumerate(zip(recordings, blocks, strict=True), start=1):
            borders = candidate_borders(recording, [found.bounds], self.hands)
            levels = compose_levels(recording, borders, models, self.longest_blocks)
            results.append(
                Actions(
                    tuple(
                        LabelledSegments(
                            np.stack([level.borders[:-1], level.borders[1:]], axis=1),
                            level.labels,
                            level.uncertainties,
                            found.rate_hz,
                            found.source,
                            found.first_frame,
                        )
                        for level in levels
                    ),
                    np.array([level.fitness for level in levels]),
                )
            )
            work.progress(done / len(recordings))
        return tuple(results)


def pick_level(
    actions: tuple[Actions, ...], config: ComposeConfig, name: str
) -> tuple[LabelledSegments, ...]:
    """Return the level that knows an action, one record for each recording."""
    config.check_action(name)
    at = next(index for index, level in enumerate(config.levels) if name in level)
    return tuple(found.levels[at] for found in actions)


def leave_out_actions(
    truth: tuple[LabelledSegments | None, ...], config: ComposeConfig | None, side: Side = "right"
) -> tuple[LabelledSegments | None, ...]:
    """Return the manual segments that are building blocks of one arm.

    Layers tell them. Where there are none, labels do: an action that holds other manual segments is
    left out; one that does not is a building block as well (thesis 8.2.2 takes the same segments
    for both).

    Parameters
    ----------
    truth : tuple of LabelledSegments or None
        Manual segments of each recording.
    config : ComposeConfig, optional
        Knows the labels of actions.
    side : "right" or "left"
        The arm.

    Returns
    -------
    tuple of LabelledSegments or None
        None where no building block is labelled.
    """
    return tuple(None if manual is None else _blocks(manual, config, side) for manual in truth)


def _blocks(
    manual: LabelledSegments, config: ComposeConfig | None, side: Side
) -> LabelledSegments | None:
    blocks = building_blocks(manual, side)
    if blocks is None or config is None or actions_of(manual) is not manual:
        return blocks
    return _leave_out(blocks, config.actions)


def _leave_out(manual: LabelledSegments, actions: tuple[str, ...]) -> LabelledSegments:
    is_action = np.array([label in actions for label in manual.labels], dtype=bool)
    starts, ends = manual.bounds[:, 0], manual.bounds[:, 1]
    inside = (starts >= starts[:, np.newaxis]) & (ends <= ends[:, np.newaxis])
    rows = np.flatnonzero(~(is_action & (inside & ~is_action).any(axis=1)))
    return manual.take(rows)


def compose_results(actions: tuple[Actions, ...]) -> dict[str, Any]:
    """Return counts by action and the fitness of each level, mean over the recordings."""
    levels = []
    for index in range(len(actions[0].levels) if actions else 0):
        labels = sorted(name for found in actions for name in found.levels[index].labels)
        levels.append(
            {
                "counts": {name: labels.count(name) for name in labels},
                "fitness": float(np.mean([found.fitness[index] for found in actions])),
            }
        )
    return {"levels": levels}
