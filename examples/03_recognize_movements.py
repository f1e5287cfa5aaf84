"""3. Recognize movements: five labelled examples of each class are enough to start with.

Labels come from a segments file beside the recording. Everything else is given the class of the
nearest example; what is too far from all of them is `unknown`.
"""

from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from besman.classifiers.nearest_neighbour import classify
from besman.config.resources import resource_folder
from besman.person.marker_set import load_marker_set
from besman.stages.label.stage import LabelConfig
from besman.stages.read.read_inputs import read_inputs
from besman.stages.recognize.model_files import load_model, save_model
from besman.stages.recognize.stage import RecognizeConfig
from besman.stages.segment.stage import ValleyVmciConfig

folder = resource_folder("data") / "stick_throw"
inputs = read_inputs([str(folder)])
labelled = LabelConfig().run(inputs.recordings, load_marker_set("right_arm"))
one, two = labelled

# Learn from the first person alone. Stretches without a label in which nothing moves are `idle`.
stage = RecognizeConfig(examples_per_class=5, seed=0)
model = stage.train((one,), inputs.truth[:1])
print(f"learnt from {one.source}: {dict(Counter(model.labels))}")
print(f"features: {', '.join(model.recipe.features)}")
print(f"unknown beyond a distance of {model.threshold:.2f} spreads of a feature")

# Name the segments of the second person, of whom nothing was learnt.
(segments,) = ValleyVmciConfig().run((two,))
(named,) = stage.run((two,), (segments,), model)
print(f"\n{two.source}: {dict(Counter(named.labels))}")
for number in range(6):
    start, end = named.bounds[number] / named.rate_hz
    label, distance = named.labels[number], named.distances[number]
    print(f"  {start:5.2f} to {end:5.2f} s  {label:10}  distance {distance:.2f}")

# How many are right? Compare with the manual segments, each with the segment that overlaps it most.
right, manual = 0, inputs.truth[1]
for (start, end), label in zip(manual.bounds, manual.labels, strict=True):
    overlap = [min(end, e) - max(start, s) for s, e in named.bounds]
    right += named.labels[overlap.index(max(overlap))] == label
print(f"{right} of {len(manual.labels)} manual segments have their label")

# The algorithms take arrays: an example is a row of numbers.
labels, distances = classify(model.examples[:2], model.examples[2:], model.labels[2:])
print(f"\ntwo examples against all others: {labels}, distances {distances.round(2)}")

# A model is two plain files, .npz and .json; a pipeline takes it with `recognize: {model: PATH}`.
with TemporaryDirectory() as place:
    save_model(model, Path(place) / "throws")
    print(f"read back: {load_model(Path(place) / 'throws').labels == model.labels}")
