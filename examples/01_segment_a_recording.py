"""1. Segment a recording: find where one movement ends and the next begins.

The recording is one of the embedded sample: a simulated person who throws a stick eight
times, seen by a motion capture system that knows the markers' names.
"""

from besman.config.resources import resource_folder
from besman.io.recordings.formats import read_recording
from besman.io.segments_json import find_segments, read_segments
from besman.person.marker_set import load_marker_set
from besman.stages.label.stage import LabelConfig
from besman.stages.segment.scores import mean_score
from besman.stages.segment.stage import ValleyVmciConfig
from besman.stages.segment.valley_vmci import find_movements

# The content of the file tells its format: Qualisys TSV, C3D, Xsens MVNX or a joint log.
path = resource_folder("data") / "stick_throw" / "subject1.tsv"
recording = read_recording(path)
seconds = recording.time[-1] - recording.time[0]
print(f"{recording.source}: {seconds:.1f} s at {recording.rate_hz:g} Hz")
print(f"trajectories: {', '.join(name or 'unnamed' for name in recording.names)}")

# A marker set says which names mean which place on the body. Short gaps are filled.
markers = load_marker_set("right_arm")
(labelled,) = LabelConfig().run((recording,), markers)

# The algorithm takes arrays: seconds (T,), and positions (T, m, 3) of m markers, metres.
hand = labelled.marker("hand_top")
found = find_movements(labelled.time, hand[:, None])
print(f"\n{len(found.rests)} pieces, {found.rests.sum()} of them rests; the first eight:")
for number in range(8):
    start, end = found.borders_s[number : number + 2]
    kind = "rest" if found.rests[number] else "movement"
    print(f"  {start:5.2f} to {end:5.2f} s  {kind}")

# Every valley of the speed has a probability of being a border.
sure = (found.candidate_probability > 0.99).sum()
print(f"{sure} of {len(found.candidates_s)} valleys are borders with more than 99 % probability")

# The same as a stage of the pipeline: records in, records out. A stage's fields are the
# keys of the pipeline's YAML file, where `method` chooses among seven.
(segments,) = ValleyVmciConfig(markers=("hand_top",)).run((labelled,))

# The segments file beside the recording holds what a person (here: the simulation) says.
manual = read_segments(find_segments(path), recording)
score = mean_score((segments,), (manual,), margin_s=0.2)
print(f"\nF1 {score.f1:.3f}")
print(f"{score.tp:g} borders found, {score.fp:g} too many, {score.fn:g} missed")
print(f"median offset {1000 * score.median_offset_s:.0f} ms")
