import numpy as np
import pytest

from besman.records import LabelledRecording, LabelledSegments

ARM = ("shoulder", "elbow", "hand_top", "hand_left", "hand_right")
BACK = ("back_top", "back_left", "back_right")
REST = {
    "back_top": (0.0, 0.0, 1.4),
    "back_left": (0.0, 0.1, 1.2),
    "back_right": (0.0, -0.1, 1.2),
    "shoulder": (0.1, -0.2, 1.4),
    "elbow": (0.1, -0.2, 1.1),
    "hand_top": (0.45, -0.2, 1.1),
    "hand_left": (0.38, -0.16, 1.1),
    "hand_right": (0.38, -0.24, 1.1),
    "box_back": (0.6, 0.0, 1.0),
}
MOVES = {"forward": (0.3, 0.0, 0.0), "up": (0.0, 0.0, 0.3), "left": (0.0, 0.3, 0.0)}


def rest_of(name):
    """Where a marker is at rest; a left arm mirrors the right one."""
    side, _, part = name.partition("_")
    if side == "left":
        return np.array(REST[part]) * (1, -1, 1)
    return np.array(REST.get(name, REST.get(part)))


def person(source, seed, names, hands, n_moves=9, move=MOVES):
    """A person who moves `hands` out and back again and again; truth beside it."""
    rng = np.random.default_rng(seed)
    rest = np.array([rest_of(name) for name in names])
    columns = [names.index(name) for name in hands]
    frames, rows, at = [], [], 0
    for label in list(move) * (n_moves // len(move)):
        n = int(rng.integers(40, 60))
        course = np.sin(np.linspace(0, np.pi, n))[:, np.newaxis, np.newaxis]
        piece = np.repeat(rest[np.newaxis], n, axis=0)
        piece[:, columns] += course * (np.array(move[label]) + rng.normal(scale=0.03, size=3))
        rows.append((at, at + n, label))
        frames += [piece, np.repeat(rest[np.newaxis], 25, axis=0)]
        at += n + 25
    positions = np.concatenate(frames)
    positions += rng.normal(scale=5e-4, size=positions.shape)
    filled = np.zeros(positions.shape[:2], dtype=bool)
    time = np.arange(len(positions)) / 50.0
    recording = LabelledRecording(time, positions, tuple(names), filled, 50.0, source)
    bounds = np.array([row[:2] for row in rows])
    labels = tuple(row[2] for row in rows)
    return recording, LabelledSegments(bounds, labels, np.zeros(len(rows)), 50.0, source)


@pytest.fixture
def make_person():
    return person


@pytest.fixture(scope="session")
def one_arm():
    """Two people with one arm and a box: recordings, truth."""
    names = [*BACK, *ARM, "box_back"]
    pairs = [person(f"{k}.tsv", k, names, ARM[2:]) for k in range(2)]
    return tuple(pair[0] for pair in pairs), tuple(pair[1] for pair in pairs)
