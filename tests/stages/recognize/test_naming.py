import numpy as np

from besman.config.stage import Work
from besman.records import Segments
from besman.stages.recognize.model import name_segments
from besman.stages.recognize.naming import name_recordings
from besman.stages.recognize.stage import RecognizeConfig


def test_every_recording_is_named_by_itself_and_keeps_its_segments(one_arm):
    recordings, truth = one_arm
    model = RecognizeConfig().train(recordings, truth)
    shares = []
    found = (truth[0], Segments(truth[1].bounds[2:], 0.0, 50.0, "1.tsv", first_frame=7))
    named = name_recordings(model, recordings, found, Work(1, shares.append))
    assert shares == [0.5, 1.0]
    for recording, segments, got in zip(recordings, found, named, strict=True):
        labels, distances = name_segments(model, recording, segments.bounds)
        assert got.labels == labels
        np.testing.assert_array_equal(got.distances, distances)
        np.testing.assert_array_equal(got.bounds, segments.bounds)
        assert (got.source, got.first_frame) == (segments.source, segments.first_frame)
