import numpy as np
import pytest
from places import REAL_DATA, TOP
from typer.testing import CliRunner

from besman.cli.main import app
from besman.config.yaml_file import parse_config
from besman.exceptions import ConfigError, SegmentationError
from besman.person.marker_set import load_marker_set
from besman.pipeline.config import PipelineConfig
from besman.records import LabelledRecording
from besman.stages.label.stage import LabelConfig
from besman.stages.read.read_inputs import read_inputs
from besman.stages.segment.kinds import SEGMENTATION_NAMES, SEGMENTATIONS
from besman.stages.segment.methods import CONFIGS, DEFAULT_METHOD
from besman.stages.segment.scores import mean_score
from besman.stages.segment.stage import SegmentConfig, ValleyVmciConfig, VmciOnlineConfig

EXACT = (ValleyVmciConfig, SegmentConfig, VmciOnlineConfig)


def record(paths, rate_hz=60.0, time=None):
    paths = np.asarray(paths, dtype=float)[:, np.newaxis]
    time = np.arange(len(paths)) / rate_hz if time is None else time
    filled = np.zeros(paths.shape[:2], dtype=bool)
    return LabelledRecording(time, paths, ("hand_top",), filled, rate_hz, "a.tsv", 5)


@pytest.fixture(scope="module")
def real():
    folder = REAL_DATA / "pick_and_place"
    if not folder.is_dir():
        pytest.skip(f"no real recordings in {folder}; set BESMAN_REAL_DATA")
    inputs = read_inputs((str(folder),))
    config = LabelConfig(longest_gap_s=0.5)
    return config.run(inputs.recordings, load_marker_set("right_arm")), inputs.truth


def thin(recording, factor):
    return LabelledRecording(
        recording.time[::factor],
        recording.positions[::factor],
        recording.markers,
        recording.filled[::factor],
        recording.rate_hz / factor,
        recording.source,
    )


def test_the_default_method_is_taken_where_none_is_named():
    content = {
        "name": "a",
        "recordings": "b",
        "robot": "ur5",
        "tool": "t",
        "task": "reach",
        "select": {"label": "c"},
    }
    for segment in ({}, {"longest_s": 3.0}, {"method": "vmci"}):
        config = parse_config({**content, "segment": segment}, PipelineConfig, "p.yaml")
        assert config.segment.method == segment.get("method", DEFAULT_METHOD)
    assert parse_config(content, PipelineConfig, "p.yaml").segment == CONFIGS[DEFAULT_METHOD]()
    with pytest.raises(ConfigError, match=r"segment.method: got 'vmcj'; did you mean 'vmci'"):
        parse_config({**content, "segment": {"method": "vmcj"}}, PipelineConfig, "p.yaml")


@pytest.mark.parametrize("config", EXACT)
def test_bad_recordings_are_refused_or_one_segment(config):
    path = np.cumsum(np.random.default_rng(0).normal(size=(90, 3)), axis=0)
    (still,) = config().run((record(np.ones((90, 3))),))
    np.testing.assert_array_equal(still.bounds, [[0, 90]])
    assert np.isnan(still.log_evidence)
    with pytest.raises(SegmentationError, match=r"a\.tsv: got 1 samples; expected at least 2"):
        config().run((record(path[:1]),))
    time = np.arange(90) / 60
    time[40:] += 0.5
    with pytest.raises(SegmentationError, match=r"frame 45 comes 0.5167 s after .* 0.01667 s"):
        config().run((record(path, time=time),))
    path[7, 1] = np.nan
    with pytest.raises(SegmentationError, match="'hand_top' was not seen in frame 12"):
        config().run((record(path),))


def test_two_samples_are_one_segment():
    (segments,) = ValleyVmciConfig().run((record(np.eye(2, 3)),))
    np.testing.assert_array_equal(segments.bounds, [[0, 2]])


def test_online_segments_are_those_of_the_whole_real_recordings(real):
    for longest_s in (4.0, 10.0):
        whole = SegmentConfig(longest_s=longest_s).run(real[0])
        online = VmciOnlineConfig(longest_s=longest_s).run(real[0])
        for one, other in zip(whole, online, strict=True):
            np.testing.assert_array_equal(one.bounds, other.bounds)
    assert VmciOnlineConfig(calibration_s=5.0).run(real[0][:1])[0].bounds[-1, 1] == 738


def test_the_default_is_as_good_as_was_measured_at_every_rate(real):
    recordings, truth = real
    segments = ValleyVmciConfig().run(recordings)
    score = mean_score(segments, truth)
    assert score.f1 > 0.94
    assert abs(score.median_offset_s) < 0.03
    assert mean_score(segments, truth, margin_s=0.1).f1 > 0.78
    for subject in (slice(0, 6), slice(6, 12)):
        assert mean_score(segments[subject], truth[subject]).f1 > 0.93
    slow = ValleyVmciConfig().run(tuple(thin(recording, 3) for recording in recordings))
    for one, other in zip(segments, slow, strict=True):
        assert len(one.bounds) == len(other.bounds)
        assert np.abs(one.bounds - 3 * other.bounds).max() <= 3


def test_border_probability_says_where_borders_are(real):
    for config in (ValleyVmciConfig(), SegmentConfig()):
        (segments,) = config.run(real[0][:1])
        probability = segments.border_probability
        assert probability.shape == real[0][0].time.shape
        assert np.all((probability >= 0) & (probability <= 1))
        inner = segments.bounds[1:, 0]
        assert probability[inner].mean() > 4 * probability.mean()


def test_the_table_and_the_help_name_every_method():
    assert tuple(CONFIGS) == SEGMENTATION_NAMES
    assert SEGMENTATION_NAMES[0] == DEFAULT_METHOD
    for entry in SEGMENTATIONS:
        assert CONFIGS[entry.name].model_fields["method"].default == entry.name
        assert entry.about
    for command in (["segment"], ["evaluate", "segmentation"]):
        told = CliRunner().invoke(app, [*command, "--help"], env={"COLUMNS": "1000"}).output
        assert all(name in told for name in SEGMENTATION_NAMES)
    page = (TOP / "docs/reference/pipeline.md").read_text()
    assert "{table-of} besman.stages.segment.kinds:SEGMENTATIONS" in page
