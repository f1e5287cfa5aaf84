"""Segmentation on stand-ins for recordings not seen here, and ways that were tried on them.

Run as ``python benchmarks/segmentation_unseen.py FOLDER``: recordings with manual segments beside
them. Stand-ins are the other two markers of the hand, the same takes a quarter faster and slower,
and takes in which time runs faster wherever the hand is slower at a border than a share of the
peaks beside it, so that no rest and no valley of the speed is left there. How long a pause is that
people cut in two does not change with the tempo, and borders set by hand move with it in these: so
there are also takes in which the movements alone are a quarter faster and slower, while pauses and
0.25 s about each border last as long as recorded. ``contacts``: where the object begins to move or
comes to rest, a border where none is within 0.4 s. ``grasps``: a turning point at which the object
begins to be carried is a pause where the hand is slower than a tenth of the peaks beside it for
0.35 s (chosen on subject 1). ``all three of the hand``: markers, in place of one. ``rests by both
speeds``: slower than 0.09 of the geometric mean of the movement's peak and of the recording's
typical speed, in place of 0.08 of the peak. Means are over recordings, of all and of the recordings
whose names begin alike up to the first underscore: subjects.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from besman.evaluation.segmentation_data import SegmentedDataset, read_dataset
from besman.records import LabelledRecording, LabelledSegments
from besman.stages.segment import valleys
from besman.stages.segment.scores import manual_borders, match_borders
from besman.stages.segment.valley_vmci import find_movements
from besman.stages.segment.valleys import GRID_HZ, ValleyShape, smooth_speed, typical_speed

MARGINS_S = (0.3, 0.1)
Find = Callable[[LabelledRecording, str], np.ndarray]
Take = tuple[LabelledRecording, str, np.ndarray]
NEAR_S, MERGED_S, BESIDE_S, LEAST_CARRY_S = 0.4, 0.15, 0.9, 0.3
MOVES_M_S = 0.05
HAND = ("hand_top", "hand_left", "hand_right")
SLOW_AT_GRASP, LEAST_AT_GRASP_S = 0.1, 0.35
# A pause, and so much about each border, lasts as long where only the movements have another tempo.
AS_RECORDED_S, BLEND_S = 0.25, 0.1


def plain(recording: LabelledRecording, marker: str, shape: ValleyShape | None = None):
    path = recording.marker(marker)[:, None]
    return find_movements(recording.time, path, shape=shape).borders_s[1:-1]


def of_three(recording: LabelledRecording, marker: str) -> np.ndarray:
    """Follow all markers of the hand, whichever is asked for."""
    path = np.stack([recording.marker(one) for one in HAND], axis=1)
    return find_movements(recording.time, path).borders_s[1:-1]


def shaped(**changes: float) -> Find:
    return lambda recording, marker: plain(recording, marker, ValleyShape(**changes))


def carries(recording: LabelledRecording) -> np.ndarray:
    """Tell when the object moves, on the grid."""
    columns = [k for k, name in enumerate(recording.markers) if name.startswith("box")]
    path = np.nanmean(recording.positions[:, columns], axis=1, keepdims=True)
    speed = smooth_speed(recording.time, path, 0.05)
    return speed > max(MOVES_M_S, 0.1 * np.quantile(speed, 0.95))


def contacts(recording: LabelledRecording) -> np.ndarray:
    moves = carries(recording)
    edges = np.flatnonzero(np.diff(moves.astype(int), prepend=0, append=0)) / GRID_HZ
    carried = edges.reshape(-1, 2)
    carried = carried[np.diff(carried, axis=1)[:, 0] > LEAST_CARRY_S]
    inside = (carried > 0) & (carried < len(moves) / GRID_HZ - MARGINS_S[1])
    return carried[inside]


def with_contacts(recording: LabelledRecording, marker: str) -> np.ndarray:
    found = plain(recording, marker)
    more = [one for one in contacts(recording) if np.abs(found - one).min(initial=9) > NEAR_S]
    return np.sort(np.concatenate([found, more]))


def with_grasps(recording: LabelledRecording, marker: str) -> np.ndarray:
    path = recording.marker(marker)[:, None]
    found = find_movements(recording.time, path)
    speed, moves = smooth_speed(recording.time, path, 0.05), carries(recording)
    rows = np.round(found.borders_s * GRID_HZ).astype(int)
    borders: list[float] = []
    for k in range(1, len(rows) - 1):
        at, low, high = rows[k], rows[k - 1], rows[k + 1]
        peak = min(speed[low : at + 1].max(), speed[at:high].max(initial=0.0))
        fast = np.flatnonzero(speed[low:high] >= SLOW_AT_GRASP * peak) + low
        first, last = fast[fast < at].max(initial=low) + 1, fast[fast > at].min(initial=high) - 1
        begins = (
            moves[last + 10 : last + 40].mean()
            > 0.5
            > moves[max(first - 40, 0) : first - 10].mean()
        )
        turns = not found.rests[k - 1 : k + 1].any() and speed[at] < SLOW_AT_GRASP * peak
        is_pause = turns and begins and (last - first) / GRID_HZ >= LEAST_AT_GRASP_S
        borders += [first / GRID_HZ, last / GRID_HZ] if is_pause else [found.borders_s[k]]
    return np.array(borders)


def fall_by(share: float, own: float, typical: float):
    """Return where the speed falls below a share of peak^own typical^(1 - own), for `valleys`."""

    def fall(piece: np.ndarray, shape: ValleyShape) -> int:
        peak = piece.max()
        under_way = int(np.flatnonzero(piece >= shape.hill * peak)[-1])
        slow = np.flatnonzero(piece[under_way:] < share * peak**own * typical ** (1 - own))
        return under_way + int(slow[0]) if slow.size else len(piece) - 1

    return fall


def by_both(share: float, own: float, least_rest_s: float = 0.45) -> Find:
    """Let rests be slower than a share of the movement's peak and the recording's typical speed."""

    def find(recording: LabelledRecording, marker: str) -> np.ndarray:
        speed = smooth_speed(recording.time, recording.marker(marker)[:, None], 0.05)
        with patch.object(valleys, "_fall", fall_by(share, own, typical_speed(speed))):
            return plain(recording, marker, ValleyShape(least_rest_s=least_rest_s))

    return find


# The mean of recordings is over these: other people, as far as the same takes can stand for them.
STAND_INS = ("hand_left", "hand_right", "a quarter faster", "a quarter slower")

WAYS: dict[str, Find] = {
    "default": plain,
    "contacts": with_contacts,
    "all three of the hand": of_three,
    "grasps": with_grasps,
    "rests from 0.3 s": shaped(least_rest_s=0.3),
    "valleys of 0.5": shaped(depth=0.5),
    "rests by both speeds": by_both(0.09, 0.5),
}


def takes_of(data: SegmentedDataset, marker: str = "hand_top", times: float = 1.0) -> list[Take]:
    takes = []
    for recording, truth in zip(data.recordings, data.truth, strict=True):
        borders = manual_borders(truth)
        inside = borders[(borders > 0) & (borders < len(recording.time) - 1)] / truth.rate_hz
        changed = replace(recording, time=recording.time / times, rate_hz=recording.rate_hz * times)
        takes.append((changed, marker, inside / times))
    return takes


def hurried(take: Take, level: float) -> Take:
    """Let time run faster at the borders, until the hand is nowhere slower than a share."""
    recording, marker, borders = take
    since = recording.time - recording.time[0]
    speed = smooth_speed(recording.time, recording.marker(marker)[:, None], 0.05)
    speed = np.interp(since, np.arange(len(speed)) / GRID_HZ, speed)
    share, beside = np.ones(len(since)), round(BESIDE_S * recording.rate_hz)
    for at in np.round(borders * recording.rate_hz).astype(int):
        low, high = max(0, at - beside), min(len(speed), at + beside)
        least = level * min(speed[low : at + 1].max(), speed[at:high].max())
        slow = speed[low:high] < least
        first = at - low - int(np.argmin(slow[: at - low + 1][::-1]))
        last = at - low + int(np.argmin(np.append(slow[at - low :], False)))
        rows = slice(low + first + 1, low + last)
        share[rows] = np.minimum(share[rows], np.maximum(speed[rows] / least, 0.02))
    changed, true = warped(recording, share, borders)
    # A rest of which nothing is left has one border.
    return changed, marker, true[np.append(True, np.diff(true) > MERGED_S)]


def warped(recording: LabelledRecording, share: np.ndarray, borders: np.ndarray):
    """Let each sample last a share of its time; return the recording and where borders come."""
    step = 1 / recording.rate_hz
    clock = np.concatenate([[0.0], np.cumsum(share[:-1] * step)])
    time = np.arange(0.0, clock[-1], step)
    flat = recording.positions.reshape(len(clock), -1)
    positions = np.stack([np.interp(time, clock, one) for one in flat.T], axis=1)
    changed = replace(
        recording,
        time=time,
        positions=positions.reshape(len(time), *recording.positions.shape[1:]),
        filled=recording.filled[np.searchsorted(clock, time, side="right") - 1],
    )
    return changed, np.interp(borders, recording.time - recording.time[0], clock)


def move_at(take: Take, truth: LabelledSegments, times: float) -> Take:
    """Let movements be faster, and pauses and what lies about borders last as long as recorded."""
    recording, marker, borders = take
    since = recording.time - recording.time[0]
    kept = np.abs(since[:, None] - borders).min(axis=1, initial=np.inf) < AS_RECORDED_S
    speed = smooth_speed(recording.time, recording.marker(marker)[:, None], 0.05)
    at_rest = np.interp(since, np.arange(len(speed)) / GRID_HZ, speed) < typical_speed(speed) / 2
    pause = np.ones(len(since), bool)
    for label, (first, last) in zip(truth.labels, truth.bounds, strict=True):
        if label != "idle":
            pause[first:last] = False
    # What moves and has no label is a movement of which only parts have one.
    for first, last in np.flatnonzero(np.diff(pause, prepend=False, append=False)).reshape(-1, 2):
        pause[first:last] = at_rest[first:last].all()
    share = np.where(kept | pause, 1.0, 1 / times)
    half = round(BLEND_S * recording.rate_hz)
    bell = np.ones(2 * half + 1) / (2 * half + 1)
    share = np.convolve(np.pad(share, half, mode="edge"), bell, mode="valid")
    changed, true = warped(recording, share, borders)
    return changed, marker, true


def score(takes: list[Take], find: Find) -> tuple[list[float], np.ndarray]:
    """Return F1 of all borders together at each margin, and that of each take, (takes, margins)."""
    figures, apart = [], []
    found = [find(recording, marker) for recording, marker, _ in takes]
    for margin in MARGINS_S:
        pairs = np.array(
            [
                len(match_borders(one, true, margin))
                for one, (*_, true) in zip(found, takes, strict=True)
            ]
        )
        n_all = [len(one) + len(true) for one, (*_, true) in zip(found, takes, strict=True)]
        figures.append(2 * pairs.sum() / sum(n_all))
        apart.append(2 * pairs / np.maximum(n_all, 1))
    return figures, np.array(apart).T


def told(figures: Sequence[float]) -> str:
    return " / ".join(f"{one:.3f}" for one in figures)


def main() -> None:
    if len(sys.argv) < 2:
        print("segmentation of what was not seen: only on real recordings, name their FOLDER")
        return
    data = read_dataset(Path(sys.argv[1]))
    usual = takes_of(data)
    sets = {
        "as recorded": usual,
        "hand_left": takes_of(data, "hand_left"),
        "hand_right": takes_of(data, "hand_right"),
        "a quarter faster": takes_of(data, times=1.25),
        "a quarter slower": takes_of(data, times=0.75),
        **{
            f"movements alone {name}": [
                move_at(take, truth, times) for take, truth in zip(usual, data.truth, strict=True)
            ]
            for name, times in (("faster", 1.25), ("slower", 0.75))
        },
        **{
            f"valleys filled to {one}": [hurried(take, one) for take in usual] for one in (0.5, 0.9)
        },
    }
    print(f"{'F1 0.3 s / 0.1 s':24}" + "".join(f"{way:>22}" for way in WAYS))
    apart: dict[str, list[np.ndarray]] = {way: [] for way in WAYS}
    for name, takes in sets.items():
        cells = []
        for way, find in WAYS.items():
            together, each = score(takes, find)
            cells.append(told(together))
            if name in STAND_INS:
                apart[way].append(each)
        print(f"{name:24}" + "".join(f"{cell:>22}" for cell in cells))
    subjects = np.array([one.source.partition("_")[0] for one in data.recordings])
    for who in ("", *sorted(set(subjects))):
        chosen = subjects == who if who else np.ones(len(subjects), bool)
        means = [told(np.mean(np.array(apart[way])[:, chosen], axis=(0, 1))) for way in WAYS]
        print(f"{f'mean {who}'.strip():24}" + "".join(f"{cell:>22}" for cell in means))


if __name__ == "__main__":
    main()
