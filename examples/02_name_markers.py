"""2. Name markers: from unnamed, broken trajectories to markers.

Passive markers all look alike: a camera system delivers dots whose trajectories break wherever a
marker is hidden, and now and then a dot that is no marker at all. One recording with names, of any
person who wears the same set, is enough to learn from.
"""

import numpy as np

from besman.config.resources import resource_folder
from besman.io.recordings.formats import read_recording
from besman.io.recordings.true_names import find_true_names, read_true_names
from besman.person.marker_set import load_marker_set
from besman.stages.label.results import count_names
from besman.stages.label.trajectories import fill_markers, learn_from_recording, name_trajectories

data = resource_folder("data")
markers = load_marker_set("right_arm")

# The teacher is another person, so that distances differ by some centimetres.
teacher = read_recording(data / "stick_throw_calibration" / "person.tsv")
model = learn_from_recording(teacher, markers)
shoulder, elbow = (model.markers.index(name) for name in ("shoulder", "elbow"))
apart, spread = model.distance[shoulder, elbow], model.spread[shoulder, elbow]
print(f"learnt: shoulder to elbow {100 * apart:.1f} cm, give or take {100 * spread:.1f} cm")

path = data / "stick_throw_unlabelled" / "subject2.tsv"
recording = read_recording(path)
print(f"{recording.source}: {recording.positions.shape[1]} trajectories without names")

# Whole fragments are named at once: no two that share a frame may have one name. Every name has a
# confidence; what is less sure than the threshold is left without one, for a person to look at.
named = name_trajectories(recording, markers, model, threshold=0.8)
given = [decision for decision in named.decisions if decision.named]
print(
    f"{len(named.decisions)} fragments, {len(given)} of them named, {len(named.review)} to look at"
)
for decision in named.review:
    seconds = (decision.stop - decision.start) / recording.rate_hz
    guess = decision.marker or "no marker"
    print(f"  {seconds:5.2f} s, best guess {guess}, confidence {decision.confidence:.2f}")

# The recording is synthetic, so that the true names are known.
truth = read_true_names(find_true_names(path), recording)
visible, right, wrong = count_names(named, truth)
print(f"marker samples: {right / visible:.2%} named right, {wrong / visible:.2%} wrong")

# Short gaps are filled: of a rigid body from its other markers, of other markers by a spline. The
# flight of a stick that the cameras lost stays a gap.
positions, filled = fill_markers(
    named.positions, named.markers, markers, longest=25, longest_rigid=100
)
for index, name in enumerate(named.markers):
    missing = np.isnan(named.positions[:, index, 0]).sum()
    left = np.isnan(positions[:, index, 0]).sum()
    if missing:
        print(f"{name}: {missing} of {len(positions)} samples missing, {left} after filling")
