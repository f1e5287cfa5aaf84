"""Simulated free throws as files, read and labelled."""

import json
import warnings

from besman.io.recordings.formats import read_recording
from besman.person.marker_set import load_marker_set
from besman.stages.label.methods import DefaultLabelConfig
from besman.stages.segment.methods import DefaultSegmentConfig
from besman.synthetic.free_throw import simulate_free_throw


def write_throws(folder, number, change=lambda content: content, **options):
    """Write throws, and return them."""
    throws = [simulate_free_throw(trial, **options) for trial in range(1, number + 1)]
    for trial, throw in enumerate(throws, start=1):
        path = folder / f"BB_FT_P0001_T{trial:04d}.json"
        path.write_text(json.dumps(change(throw.content)))
    return throws


def with_landing(throw):
    """Return what the file of a throw holds that says where the ball passed the ring."""
    return {**throw.content, **dict(zip(("landing_x", "landing_y"), throw.on_ring_in, strict=True))}


def label_throws(folder):
    """Read and label what stands in a folder; return recordings and segments."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        recordings = tuple(read_recording(path) for path in sorted(folder.glob("*.json")))
    markers = load_marker_set("spl")
    labelled = DefaultLabelConfig(markers="spl").run(recordings, markers, None)
    return labelled, DefaultSegmentConfig(markers=markers.hand).run(labelled)
