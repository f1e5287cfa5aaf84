import dataclasses

import numpy as np

from besman.config.stage import Truth
from besman.records import LabelledRecording, LabelledSegments
from besman.report.terminal import left_out
from besman.stages.recognize.stage import RecognizeConfig

MARKERS = {
    "back_top": (0.0, 0.0, 1.4),
    "back_left": (0.0, 0.1, 1.2),
    "back_right": (0.0, -0.1, 1.2),
    "shoulder": (0.1, -0.2, 1.4),
    "elbow": (0.1, -0.2, 1.1),
    "hand_top": (0.45, -0.2, 1.1),
    "hand_left": (0.38, -0.16, 1.1),
    "hand_right": (0.38, -0.24, 1.1),
}
WAYS = {"forward": (0.3, 0.0, 0.0), "up": (0.0, 0.0, 0.3)}
RATE_HZ = 50.0


def demonstrate():
    """Four times forward and up, each followed by rest."""
    rng = np.random.default_rng(0)
    positions = np.repeat(np.array(list(MARKERS.values()))[np.newaxis], 8 * 80, axis=0)
    rows = [(80 * k, 80 * k + 50, label) for k, label in enumerate(list(WAYS) * 4)]
    for start, end, label in rows:
        course = np.sin(np.linspace(0, np.pi, end - start))[:, np.newaxis, np.newaxis]
        positions[start:end, 5:] += course * np.array(WAYS[label])
    positions += rng.normal(scale=5e-4, size=positions.shape)
    time = np.arange(len(positions)) / RATE_HZ
    filled = np.zeros(positions.shape[:2], dtype=bool)
    recording = LabelledRecording(time, positions, tuple(MARKERS), filled, RATE_HZ, "a.tsv")
    return recording, manual(rows)


def manual(rows):
    bounds = np.array([row[:2] for row in rows])
    labels = tuple(row[2] for row in rows)
    return LabelledSegments(bounds, labels, np.zeros(len(rows)), RATE_HZ, "a.tsv")


def test_moving_stretches_without_a_label_are_counted_and_not_compared():
    recording, truth = demonstrate()
    stage = RecognizeConfig(examples_per_class=2)
    model = stage.train((recording,), (truth,))
    # Nobody has labelled the last movement: it is neither rest nor one of the classes.
    known = truth.take(range(7))
    detected = dataclasses.replace(
        stage.run((recording,), (truth,), model)[0], labels=("idle",) * 8
    )
    results = stage.figures((detected,), Truth((known,)), (recording,), (truth,), model)
    assert results["n_left_out"] == 1
    assert "idle" not in results["confusion"]
    everything = stage.model_copy(update={"idle_speed_m_s": 100.0})
    all_of_it = everything.figures((detected,), Truth((known,)), (recording,), (truth,), model)
    assert all_of_it["n_left_out"] == 0
    assert all_of_it["n_compared_manual"] == results["n_compared_manual"] + 1


def test_what_is_left_out_is_said():
    assert left_out(0) == ""
    assert left_out(2) == "; 2 unlabelled, in which the hand moves, left out"
