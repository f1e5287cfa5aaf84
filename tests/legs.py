"""A walking person of whom only the legs wear markers."""

import numpy as np

from besman.records import Recording

PARTS = {"thigh": 4, "shank": 4, "foot": 3}


def walking_legs(seed, seconds=6.0, rate_hz=100.0):
    """Two legs with 22 unnamed markers stuck on at random; hips 0.9 m above the floor."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate_hz)) / rate_hz
    hip = np.stack([1.2 * time - 3.0, 0.0 * time, 0.9 + 0.02 * np.sin(12.0 * time)], axis=1)
    columns = []
    for side, phase in ((0.1, 0.0), (-0.1, np.pi)):
        swing = 0.45 * np.sin(6.0 * time + phase)
        bend = swing - 0.5 * (1.0 - np.cos(6.0 * time + phase - 1.0))
        start = hip + np.array([0.0, side, 0.0])
        for (_, n), angle, length in zip(
            PARTS.items(), (swing, bend, bend + np.pi / 2), (0.42, 0.40, 0.18), strict=True
        ):
            along = np.stack([np.sin(angle), 0.0 * time, -np.cos(angle)], axis=1)
            ahead = np.stack([np.cos(angle), 0.0 * time, np.sin(angle)], axis=1)
            for _ in range(n):
                at, off, out = rng.uniform((0.1, -0.06, -0.06), (0.9, 0.06, 0.06))
                columns.append(
                    start + at * length * along + off * ahead + np.array([0.0, out, 0.0])
                )
            start = start + length * along
    positions = np.stack(columns, axis=1) + rng.normal(scale=3e-4, size=(len(time), 22, 3))
    return Recording(time, positions, (None,) * 22, rate_hz, f"legs{seed}.tsv")
