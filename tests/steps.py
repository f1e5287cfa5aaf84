"""Two-armed stepping: a tiny person in memory whose blocks and actions are known."""

import numpy as np

from besman.records import LabelledRecording, LabelledSegments

RATE_HZ = 50.0
WAYS = {
    "up": np.array([0.0, 0.0, 0.15]),
    "down": np.array([0.0, 0.0, -0.15]),
    "left": np.array([0.0, 0.15, 0.0]),
    "right": np.array([0.0, -0.15, 0.0]),
}
ACTIONS = {"step_up": ("left", "up", "left", "up"), "step_down": ("down", "right") * 2}
MARKERS = ("back_top", "back_left", "back_right", "hand_top", "elbow", "shoulder")


def step_recording(actions, seed=0, source="steps.tsv", prefix=""):
    """Minimum-jerk blocks, 0.5 to 0.7 s each; returns recording, blocks and actions."""
    rng = np.random.default_rng(seed)
    pieces, bounds, labels = [], [], []
    where, row = np.array([0.4, -0.2, 1.0]), 0
    for action in actions:
        first = row
        for way in ACTIONS[action]:
            n = int(RATE_HZ * rng.uniform(0.5, 0.7))
            s = np.arange(n) / n
            course = (10 * s**3 - 15 * s**4 + 6 * s**5)[:, np.newaxis]
            step = WAYS[way] + rng.normal(scale=0.004, size=3)
            pieces.append(where + step * course)
            where = where + step
            bounds.append((row, row + n))
            labels.append(way)
            row += n
        bounds.append((first, row))
        labels.append(action)
    hand = np.concatenate(pieces)
    shoulder = np.array([0.0, -0.2, 1.4])
    still = np.array([[-0.1, 0.0, 1.4], [-0.1, 0.1, 1.3], [-0.1, -0.1, 1.3]])
    positions = np.concatenate(
        [
            np.broadcast_to(still, (row, 3, 3)),
            np.stack([hand, 0.5 * (hand + shoulder), np.broadcast_to(shoulder, (row, 3))], axis=1),
        ],
        axis=1,
    )
    positions = positions + rng.normal(scale=3e-4, size=positions.shape)
    recording = LabelledRecording(
        np.arange(row) / RATE_HZ,
        positions,
        (*MARKERS[:3], *(prefix + name for name in MARKERS[3:])),
        np.zeros((row, 6), dtype=bool),
        RATE_HZ,
        source,
    )

    def layer(wanted):
        rows = [k for k, label in enumerate(labels) if (label in ACTIONS) == wanted]
        return LabelledSegments(
            np.array([bounds[k] for k in rows]),
            tuple(labels[k] for k in rows),
            np.zeros(len(rows)),
            RATE_HZ,
            source,
        )

    return recording, layer(False), layer(True)
