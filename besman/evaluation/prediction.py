"""Experiment: which block comes next, over how much of it was seen."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from besman.evaluation.recognition_data import bridge_gaps, is_synthetic, name_parts
from besman.exceptions import RecognitionError
from besman.following.beginnings import end_rows
from besman.following.foreseeing import BlockForeseer
from besman.following.foresight import Foresight
from besman.following.rests import follows_at_once
from besman.records import LabelledRecording, LabelledSegments
from besman.records.layers import IDLE
from besman.stages.read.read_inputs import read_inputs
from besman.stages.recognize.examples import find_candidates
from besman.stages.recognize.stage import RecognizeConfig

if TYPE_CHECKING:
    from rich.table import Table

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[float], None]

SHARES = (0.0, 0.2, 0.4, 0.6)
"""How much of a block is seen; 0: it has not begun."""

METHODS = ("order and movement", "order", "movement")
RIVALS = ("most frequent block", "most frequent next", "same as last time")
"""Without a model: always the same; what followed the last block most often, or last."""

LEFT_OUT = ("recording", "subject")


class NamedTake(NamedTuple):
    """One recording and its blocks.

    Attributes
    ----------
    recording : LabelledRecording
    blocks : LabelledSegments
        In the order of time, rests as ``idle``.
    """

    recording: LabelledRecording
    blocks: LabelledSegments

    @property
    def subject(self) -> str:
        """What the recording's name begins with, up to the first underscore."""
        return Path(self.recording.source).stem.split("_")[0]


class _Guess(NamedTuple):
    """One block that was foreseen: its row in the labels, and what each method said."""

    truth: int
    said: dict[str, FloatArray]
    start_error_s: float


def load_performances(data: Path) -> list[NamedTake]:
    """Read recordings and the blocks that a person named.

    Parameters
    ----------
    data : Path
        Folder of recordings with segments beside them.

    Raises
    ------
    BesmanError
        If a file cannot be read, or there are fewer than two recordings with segments.
    """
    inputs = read_inputs([str(data)])
    recordings = [bridge_gaps(name_parts(recording)) for recording in inputs.recordings]
    truth = [segments for segments in inputs.truth if segments is not None]
    stage = RecognizeConfig()
    found = find_candidates(recordings, truth, stage.idle_s, stage.idle_speed_m_s)
    performances = []
    for recording in recordings:
        own = [one for one in found if one.recording is recording]
        if own:
            blocks = LabelledSegments(
                np.array([one.bounds for one in own]),
                tuple(one.label for one in own),
                np.zeros(len(own)),
                recording.rate_hz,
                recording.source,
                recording.first_frame,
            )
            performances.append(NamedTake(recording, blocks))
    if len(performances) < 2:
        raise RecognitionError(
            f"{data}: got {len(performances)} recordings with segments; expected two or more, to "
            "learn from some what is foreseen in the others"
        )
    return performances


def evaluate_prediction(data: Path, progress: Progress = lambda done: None) -> dict[str, Any]:
    """Foresee every block of every recording from the others.

    Parameters
    ----------
    data : Path
        As of `load_performances`.
    progress : callable
        Gets the share done.

    Returns
    -------
    dict
        ``experiment`` and ``rows``; a row has dataset, source, left_out (``recording`` or
        ``subject``: what nothing was learnt from), blocks (``movements``: rests are passed over;
        ``movements and rests``: they are blocks that may come next), seen_share, method, n (blocks
        foreseen), top1 (share of them that were the most probable), log_loss (nats a block) and,
        of ``order and movement``, start_error_s: the median error of when the next movement starts.
        ``order_entropy`` of ``figures`` is 0 if every block is always followed by the same.

    Raises
    ------
    BesmanError
        As `load_performances`.
    """
    performances = load_performances(data)
    source = "synthetic" if is_synthetic(data) else "real"
    rows = []
    for index, left_out in enumerate(LEFT_OUT):
        folds = _divide(performances, left_out)
        if len(folds) < 2:
            continue
        guesses: dict[tuple[str, float], list[_Guess]] = {}
        for k, (learnt, told) in enumerate(folds):
            for key, guess in _foresee(learnt, told):
                guesses.setdefault(key, []).append(guess)
            progress((index + (k + 1) / len(folds)) / len(LEFT_OUT))
        common = {"dataset": data.resolve().name, "source": source, "left_out": left_out}
        for (blocks, share), own in sorted(guesses.items()):
            rows += _rows({**common, "blocks": blocks, "seen_share": share}, own)
    return {
        "experiment": "prediction",
        "rows": rows,
        "figures": {
            "order_entropy": _order_entropy(performances),
            "seconds_per_sample": time_samples(performances),
        },
    }


def _divide(
    performances: Sequence[NamedTake], left_out: str
) -> list[tuple[list[NamedTake], list[NamedTake]]]:
    """Return what is learnt from and what is foreseen, of each fold."""
    keys = [one.subject if left_out == "subject" else one.recording.source for one in performances]
    return [
        (
            [one for one, own in zip(performances, keys, strict=True) if own != key],
            [one for one, own in zip(performances, keys, strict=True) if own == key],
        )
        for key in dict.fromkeys(keys)
    ]


def _learn(learnt: Sequence[NamedTake]) -> Foresight:
    """Learn with features as the recognition makes them."""
    recordings = [one.recording for one in learnt]
    recipe = RecognizeConfig().make_recipe(recordings, [1])
    return Foresight(recordings, [one.blocks for one in learnt], recipe)


def _foresee(
    learnt: Sequence[NamedTake], told: Sequence[NamedTake]
) -> Iterator[tuple[tuple[str, float], _Guess]]:
    """Foresee every block; yields blocks and share, and the guess."""
    foresight = _learn(learnt)
    labels = foresight.labels
    for one in told:
        recording, blocks = one
        parts = foresight.parts(recording.markers, recording.source)
        for k, (label, (start, end)) in enumerate(zip(blocks.labels, blocks.bounds, strict=True)):
            if label not in labels:
                continue
            speed_m_s = float("nan")
            if follows_at_once(blocks, k):
                ended = recording.positions[:start][-end_rows(recording.rate_hz) :]
                speed_m_s = parts.end_speed(ended, recording.rate_hz)
            expected = foresight.expect(blocks.labels[:k], speed_m_s)
            pace = foresight.pace(
                blocks.labels[:k], (blocks.bounds[:k, 0] / blocks.rate_hz).tolist()
            )
            for share in SHARES:
                n = round(share * (end - start))
                seen = parts.extract(recording.positions[start : start + n], recording.rate_hz)
                both = foresight.weigh(expected, seen)
                even = (np.full(len(labels), 1 / len(labels)), expected[1])
                said = {
                    "order and movement": both.now,
                    "order": foresight.weigh(expected).now,
                    "movement": foresight.weigh(even, seen).now,
                }
                elapsed_s = n / recording.rate_hz
                error = abs(
                    foresight.seconds_to_next(both.label, elapsed_s, pace)
                    - _seconds_to_next(blocks, k, elapsed_s)
                )
                rest = _rivals(learnt, blocks.labels[:k], labels)
                truth = labels.index(label)
                yield ("movements and rests", share), _Guess(truth, {**said, **rest}, error)
                if label != IDLE:
                    before = [name for name in blocks.labels[:k] if name != IDLE]
                    rest = _rivals([_without_rests(own) for own in learnt], before, labels[:-1])
                    moved = {name: own[:-1] / own[:-1].sum() for name, own in said.items()}
                    yield ("movements", share), _Guess(truth, {**moved, **rest}, error)


def _without_rests(one: NamedTake) -> NamedTake:
    """Leave the rests out."""
    rows = [k for k, label in enumerate(one.blocks.labels) if label != IDLE]
    return one._replace(blocks=one.blocks.take(rows))


def _seconds_to_next(blocks: LabelledSegments, k: int, elapsed_s: float) -> float:
    """Return how long after so much of a block the next movement starts; NaN if there is none."""
    for j in range(k + 1, len(blocks.labels)):
        if blocks.labels[j] != IDLE:
            apart = blocks.bounds[j, 0] - blocks.bounds[k, 0]
            return float(apart / blocks.rate_hz - elapsed_s)
    return float("nan")


def _rivals(
    learnt: Sequence[NamedTake], before: Sequence[str], labels: Sequence[str]
) -> dict[str, FloatArray]:
    """Return what is said without a model; every count is smoothed by one, spread evenly."""
    last = before[-1] if before else ""
    sequences = [("", *one.blocks.labels) for one in learnt] + [("", *before)]
    followers = [
        after for sequence in sequences for own, after in pairwise(sequence) if own == last
    ]
    every = [label for one in learnt for label in one.blocks.labels]
    counts = (Counter(every), Counter(followers), Counter(followers[-1:]))
    said = {}
    for name, count in zip(RIVALS, counts, strict=True):
        own = np.array([count[label] for label in labels], dtype=np.float64)
        said[name] = (own + 1 / len(labels)) / (own.sum() + 1)
    return said


def _rows(common: dict[str, Any], guesses: Sequence[_Guess]) -> list[dict[str, Any]]:
    """Return the figures of each method."""
    rows = []
    truth = np.array([guess.truth for guess in guesses])
    for method in (*METHODS, *RIVALS):
        said = np.stack([guess.said[method] for guess in guesses])
        row = {
            **common,
            "method": method,
            "n": len(guesses),
            "top1": float(np.mean(said.argmax(axis=1) == truth)),
            "log_loss": max(0.0, float(-np.mean(np.log(said[np.arange(len(truth)), truth])))),
        }
        errors = np.array([guess.start_error_s for guess in guesses])
        if method == METHODS[0] and np.isfinite(errors).any():
            row["start_error_s"] = float(np.nanmedian(errors))
        rows.append(row)
    return rows


def _order_entropy(performances: Sequence[NamedTake]) -> float:
    """Return the mean entropy of the movement that follows another, nats."""
    pairs: Counter[tuple[str, str]] = Counter()
    for one in performances:
        moved = [label for label in one.blocks.labels if label != IDLE]
        pairs.update(zip(("", *moved), moved, strict=False))
    before: Counter[str] = Counter()
    for (label, _), n in pairs.items():
        before[label] += n
    total = sum(pairs.values())
    return float(sum(n / total * np.log(before[label] / n) for (label, _), n in pairs.items()))


def time_samples(performances: Sequence[NamedTake], rounds: int = 3) -> float:
    """Return what foreseeing adds to a sample of a stream: CPU seconds, the mean of a recording.

    Parameters
    ----------
    performances : sequence of NamedTake
        Learnt from; the last one is given sample by sample with its borders.
    rounds : int
        The quickest counts.
    """
    recording, blocks = performances[-1]
    foresight = _learn(performances)
    every = [
        (*rows, label) for rows, label in zip(blocks.bounds.tolist(), blocks.labels, strict=True)
    ]
    known = [[one for one in every if one[1] <= row] for row in range(len(recording.time))]
    seconds = []
    for _ in range(rounds):
        foreseer = BlockForeseer(
            "right", foresight, recording.markers, recording.rate_hz, recording.source
        )
        started = time.process_time()
        for row, own in enumerate(known):
            foreseer.update(own, row + 1, recording.positions[: row + 1])
        seconds.append(time.process_time() - started)
    return min(seconds) / len(known)


def prediction_tables(result: dict[str, Any]) -> list[Table]:
    """Return a table for each of what is left out and what is foreseen, for the terminal."""
    from rich.table import Table

    tables = []
    groups = dict.fromkeys((row["left_out"], row["blocks"]) for row in result["rows"])
    for left_out, blocks in groups:
        chosen = [
            row for row in result["rows"] if (row["left_out"], row["blocks"]) == (left_out, blocks)
        ]
        first = chosen[0]
        table = Table(
            title=f"{first['dataset']} ({first['source']}), new {left_out}: {first['n']} {blocks}; "
            "top-1, log loss",
            title_justify="left",
            box=None,
        )
        table.add_column("method", no_wrap=True)
        for share in SHARES:
            table.add_column(f"{share:.0%} seen", justify="right", no_wrap=True, min_width=12)
        for method in (*METHODS, *RIVALS):
            own = {row["seen_share"]: row for row in chosen if row["method"] == method}
            cells = [f"{own[s]['top1']:.1%} {own[s]['log_loss']:5.2f}" for s in SHARES]
            table.add_row(method, *cells)
        errors = [row for row in chosen if "start_error_s" in row]
        if errors:
            cells = [f"{row['start_error_s']:.2f} s" for row in errors]
            table.add_row("start of the next, error", *cells)
        tables.append(table)
    return tables


def prediction_note(result: dict[str, Any]) -> str:
    """Return what foreseeing costs, and how free the order of blocks is, as a line."""
    figures = result["figures"]
    always = " (every movement is always followed by the same)"
    note: str = (
        f"{1e3 * figures['seconds_per_sample']:.3f} ms of CPU a sample; entropy of the movement "
        f"after another: {figures['order_entropy']:.2f} nats"
    )
    return note + always if figures["order_entropy"] < 1e-9 else note
