"""Movements that blend into each other, and single curved ones: borders found, and found too many.

Run as ``python benchmarks/segmentation_blends.py [--json FILE]``. Synthetic: minimum-jerk reaches
of 0.8 to 1.4 s that begin before the one before them has ended, and turn by 50 to 150 degrees; the
true border is the middle of their common time, a border counts within 0.3 s. Then single movements
along arcs, in which there is none to be found. ``speed alone`` looks for valleys of the speed only.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from unittest.mock import patch

import numpy as np

from besman.stages.segment import valley_vmci
from besman.stages.segment.scores import match_borders
from besman.stages.segment.valleys import ValleyShape

RATE_HZ = 100.0
N_REACHES = 8
N_RECORDINGS = 40
OVERLAPS = (0.2, 0.35, 0.5)
ARCS_DEG = (60, 120, 180, 240)
NOISE_M = 2e-4
MARGIN_S = 0.3
SHAPE = ValleyShape(least=0.02)


def bell(share):
    s = np.clip(share, 0.0, 1.0)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def blend(seed: int, overlap: float):
    rng = np.random.default_rng(seed)
    durations = rng.uniform(0.8, 1.4, N_REACHES)
    starts = np.concatenate([[0.0], np.cumsum(durations[:-1] * (1 - overlap))])
    time = np.arange(0.0, starts[-1] + durations[-1], 1 / RATE_HZ)
    path = NOISE_M * rng.normal(size=(len(time), 3))
    angle = rng.uniform(0.0, 2 * np.pi)
    for start, duration in zip(starts, durations, strict=True):
        way = rng.uniform(0.25, 0.5) * np.array([np.cos(angle), np.sin(angle), 0.2 * rng.normal()])
        path += way * bell((time - start) / duration)[:, None]
        angle += rng.choice([-1, 1]) * np.radians(rng.uniform(50.0, 150.0))
    return time, path[:, None], (starts[1:] + starts[:-1] + durations[:-1]) / 2


def arc(seed: int, turn_deg: float):
    rng = np.random.default_rng(seed)
    duration, rest = rng.uniform(0.5, 1.2), 1.0
    time = np.arange(0.0, duration + 2 * rest, 1 / RATE_HZ)
    angle = np.radians(turn_deg) * bell((time - rest) / duration)
    path = 0.4 * np.stack([np.cos(angle), np.sin(angle), 0.1 * angle], axis=1)
    return time, (path + NOISE_M * rng.normal(size=path.shape))[:, None], duration


def count(found, true) -> np.ndarray:
    n = len(match_borders(found, true, MARGIN_S))
    return np.array([n, len(found) - n, len(true) - n])


def measure() -> dict[str, float]:
    figures = {}
    for overlap in OVERLAPS:
        total = np.zeros(3)
        for seed in range(N_RECORDINGS):
            time, path, true = blend(seed, overlap)
            found = valley_vmci.find_movements(time, path, shape=SHAPE).borders_s[1:-1]
            total += count(found, true)
        figures[f"f1 blend {overlap:g}"] = 2 * total[0] / (2 * total[0] + total[1] + total[2])
    for turn in ARCS_DEG:
        split = 0
        for seed in range(N_RECORDINGS):
            time, path, duration = arc(seed, turn)
            found = valley_vmci.find_movements(time, path, shape=SHAPE).borders_s
            split += bool(np.any((found > 1.1) & (found < 0.9 + duration)))
        figures[f"split arcs {turn}"] = split / N_RECORDINGS
    return figures


def main() -> None:
    ways = {"default": measure()}
    with patch.object(valley_vmci, "speed_ahead", lambda path, speed, rate_hz: speed):
        ways["speed alone"] = measure()
    print(f"{'':20}" + "".join(f"{way:>14}" for way in ways))
    for name in ways["default"]:
        print(f"{name:20}" + "".join(f"{figures[name]:14.3f}" for figures in ways.values()))
    if "--json" in sys.argv:
        Path(sys.argv[sys.argv.index("--json") + 1]).write_text(json.dumps(ways, indent=1))


if __name__ == "__main__":
    main()
