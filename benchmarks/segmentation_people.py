"""What the segmentation of a person not seen here may come to: chosen on one, measured on others.

Run as ``python benchmarks/segmentation_people.py FOLDER``: recordings with manual segments beside
them, whose names begin alike up to the first underscore if they are of one person.

First the default as recorded: its mean F1 over recordings with the interval in which 90 % of the
means of as many recordings lie that are drawn again, of each person as many as there are. It tells
what other recordings of the same people would do; two people say little about a third.

Then rests are tried anew: slower than a share of peak^own typical^(1 - own), for so many seconds.
What is best on one person (mean F1 of both margins, as recorded and of the stand-ins of
``segmentation_unseen.py``) is measured on the others; then the means over people. Last, what a rule
gains over the default on the same recordings, with its interval, and how many recordings have, as
streams with the pace of the other people, the borders that they have as a whole.
"""

from __future__ import annotations

import sys
from itertools import product
from pathlib import Path
from unittest.mock import patch

import numpy as np
from segmentation_unseen import (
    MARGINS_S,
    STAND_INS,
    Find,
    Take,
    by_both,
    fall_by,
    plain,
    score,
    takes_of,
)

from besman.evaluation.segmentation_data import SegmentedDataset, read_dataset
from besman.stages.segment import valleys
from besman.stages.segment.valley_online import OnlineMovements, measure_pace, pool_paces

SHARES, LEAST_RESTS_S, OWN = (0.07, 0.08, 0.09, 0.1, 0.11), (0.4, 0.45, 0.5), (1.0, 0.5, 0.25)
RULE = (0.09, 0.45, 0.5)
N_DRAWS, INTERVAL, SEED = 4000, (0.05, 0.95), 0


def score_all(sets: list[list[Take]], find: Find) -> np.ndarray:
    """Return F1, shape (sets, margins, recordings)."""
    return np.array([score(takes, find)[1].T for takes in sets])


def spread(figures: np.ndarray, people: np.ndarray) -> str:
    """Return the mean of one figure a recording, its interval, and those of each person."""
    rng = np.random.default_rng(SEED)
    drawn = [
        rng.choice(np.flatnonzero(people == one), (N_DRAWS, int((people == one).sum())))
        for one in np.unique(people)
    ]
    low, high = np.quantile(figures[np.concatenate(drawn, axis=1)].mean(axis=1), INTERVAL)
    apart = ", ".join(f"{one} {figures[people == one].mean():+.3f}" for one in np.unique(people))
    return f"{figures.mean():+.3f} [{low:+.3f}, {high:+.3f}] ({apart})"


def main() -> None:
    if len(sys.argv) < 2:
        print("segmentation of people: only on real recordings, name their FOLDER")
        return
    data = read_dataset(Path(sys.argv[1]))
    people = np.array([one.source.partition("_")[0] for one in data.recordings])
    sets = [
        takes_of(data),
        takes_of(data, "hand_left"),
        takes_of(data, "hand_right"),
        takes_of(data, times=1.25),
        takes_of(data, times=0.75),
    ]
    usual = score_all(sets, plain)
    for k, margin in enumerate(MARGINS_S):
        print(f"default, as recorded, {margin} s: {spread(usual[0, k], people)}")
    tried = {
        (share, least, own): score_all(sets, by_both(share, own, least))
        for share, least, own in product(SHARES, LEAST_RESTS_S, OWN)
    }
    print(f"\n{'chosen on':12}{'own':>5}{'share':>7}{'s':>6}{'as recorded':>16}{'stand-ins':>16}")
    others: dict[float, list[np.ndarray]] = {own: [] for own in OWN}
    for one in np.unique(people):
        here, there = people == one, people != one
        print(f"{one:12}{'default':>18}" + told(usual[..., there]))
        for own in OWN:
            best = max(
                (key for key in tried if key[2] == own),
                key=lambda key: tried[key][..., here].mean(),
            )
            row = f"{one:12}{own:5}{best[0]:7}{best[1]:6}"
            others[own].append(tried[best][..., there])
            print(row + told(others[own][-1]))
    for own, figures in others.items():
        # Each person counts as much, however many recordings there are of the others.
        alike = np.mean([one.mean(axis=-1) for one in figures], axis=0)[..., np.newaxis]
        print(f"{'mean':12}{own:5}{'':13}" + told(alike))
    print(f"\nshare {RULE[0]}, {RULE[1]} s, own {RULE[2]}: gain over the default")
    gain = tried[RULE] - usual
    for k, margin in enumerate(MARGINS_S):
        print(f"as recorded, {margin} s: {spread(gain[0, k], people)}")
        print(f"{len(STAND_INS)} stand-ins, {margin} s: {spread(gain[1:, k].mean(axis=0), people)}")
    share, least, own = RULE
    print(f"streams as the whole, default: {streams(data, people, plain)}")
    rule = streams(data, people, by_both(share, own, least), (share, own))
    print(f"streams as the whole, by both speeds: {rule}")


def streams(data: SegmentedDataset, people: np.ndarray, find: Find, rule=None) -> str:
    """Say how many streams have the borders of the whole, with the pace of the other people."""
    paths = [one.marker("hand_top")[:, None] for one in data.recordings]
    paces = [measure_pace(one.time, x) for one, x in zip(data.recordings, paths, strict=True)]
    same, together = 0, 0
    for k, (recording, path) in enumerate(zip(data.recordings, paths, strict=True)):
        pace = pool_paces([paces[i] for i in np.flatnonzero(people != people[k])])
        fall = fall_by(*rule, pace.typical) if rule else valleys._fall
        stream = OnlineMovements(pace, recording.rate_hz)
        with patch.object(valleys, "_fall", fall):
            rows = [row for sample in path for row in stream.update(sample)] + stream.finish()
        whole = np.round(find(recording, "hand_top") * recording.rate_hz).astype(int)
        same += rows == whole.tolist()
        together += len(np.intersect1d(rows, whole))
    return f"{same} of {len(paths)}, {together} borders"


def told(figures: np.ndarray) -> str:
    """Return the means as recorded and of the stand-ins, of others than those chosen on."""
    parts = figures[0].mean(axis=-1), figures[1:].mean(axis=(0, 2))
    return "".join(f"{' / '.join(f'{one:.3f}' for one in part):>16}" for part in parts)


if __name__ == "__main__":
    main()
