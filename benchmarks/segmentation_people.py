"""What the segmentation of a person not seen here may come to: chosen on one, measured on others.

Run as ``python benchmarks/segmentation_people.py FOLDER``: recordings with manual segments beside
them, whose names begin alike up to the first underscore if they are of one person.

First the default as recorded: its mean F1 over recordings with the interval in which 90 % of the
means of as many recordings lie that are drawn again, of each person as many as there are. It tells
what other recordings of the same people would do; two people say little about a third.

Then rests are tried anew: slower than a share of peak^own typical^(1 - own), for so many seconds.
What is best on one person (mean F1 of both margins, as recorded and of the stand-ins of
``segmentation_unseen.py``) is measured on the others. Last, what a rule gains over the default on
the same recordings, with its interval.
"""

from __future__ import annotations

import sys
from itertools import product
from pathlib import Path

import numpy as np
from segmentation_unseen import MARGINS_S, STAND_INS, Find, Take, by_both, plain, score, takes_of

from besman.evaluation.segmentation_data import read_dataset

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
    for one in np.unique(people):
        here, there = people == one, people != one
        print(f"{one:12}{'default':>18}" + told(usual[..., there]))
        for own in OWN:
            best = max(
                (key for key in tried if key[2] == own),
                key=lambda key: tried[key][..., here].mean(),
            )
            row = f"{one:12}{own:5}{best[0]:7}{best[1]:6}"
            print(row + told(tried[best][..., there]))
    print(f"\nshare {RULE[0]}, {RULE[1]} s, own {RULE[2]}: gain over the default")
    gain = tried[RULE] - usual
    for k, margin in enumerate(MARGINS_S):
        print(f"as recorded, {margin} s: {spread(gain[0, k], people)}")
        print(f"{len(STAND_INS)} stand-ins, {margin} s: {spread(gain[1:, k].mean(axis=0), people)}")


def told(figures: np.ndarray) -> str:
    """Return the means as recorded and of the stand-ins, of others than those chosen on."""
    parts = figures[0].mean(axis=-1), figures[1:].mean(axis=(0, 2))
    return "".join(f"{' / '.join(f'{one:.3f}' for one in part):>16}" for part in parts)


if __name__ == "__main__":
    main()
