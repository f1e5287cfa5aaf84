import numpy as np
import pytest
from places import REAL_DATA
from pydantic import ValidationError

from besman.config.stage import Work
from besman.exceptions import RecognitionError
from besman.records import LabelledRecording, LabelledSegments, Segments
from besman.stages.recognize.features import count_channels
from besman.stages.recognize.scores import score_labels
from besman.stages.recognize.stage import RecognizeConfig

NAMES = (
    "back_top",
    "back_left",
    "back_right",
    "shoulder",
    "elbow",
    "hand_top",
    "hand_left",
    "hand_right",
    "box_back",
)
REST = np.array(
    [
        [0.0, 0.0, 1.4],
        [0.0, 0.1, 1.2],
        [0.0, -0.1, 1.2],
        [0.1, -0.2, 1.4],
        [0.1, -0.2, 1.1],
        [0.45, -0.2, 1.1],
        [0.38, -0.16, 1.1],
        [0.38, -0.24, 1.1],
        [0.6, 0.0, 1.0],
    ]
)
MOVES = {"forward": [0.3, 0.0, 0.0], "up": [0.0, 0.0, 0.3], "left": [0.0, 0.3, 0.0]}


def demonstrate(source, seed, n_moves=9):
    """A person who moves the hand out and rests again and again; truth beside it."""
    rng = np.random.default_rng(seed)
    order = list(MOVES) * (n_moves // len(MOVES))
    frames, rows = [], []
    for label in order:
        n = int(rng.integers(40, 60))
        course = np.sin(np.linspace(0, np.pi, n))[:, np.newaxis, np.newaxis]
        piece = np.repeat(REST[np.newaxis], n, axis=0)
        piece[:, 5:8] += course * (np.array(MOVES[label]) + rng.normal(scale=0.03, size=3))
        start = sum(len(frame) for frame in frames)
        rows.append((start, start + n, label))
        frames += [piece, np.repeat(REST[np.newaxis], 25, axis=0)]
    positions = np.concatenate(frames)
    positions += rng.normal(scale=5e-4, size=positions.shape)
    filled = np.zeros(positions.shape[:2], dtype=bool)
    time = np.arange(len(positions)) / 50.0
    recording = LabelledRecording(time, positions, NAMES, filled, 50.0, source)
    bounds = np.array([row[:2] for row in rows])
    labels = tuple(row[2] for row in rows)
    return recording, LabelledSegments(bounds, labels, np.zeros(len(rows)), 50.0, source)


@pytest.fixture(scope="module")
def people():
    pairs = [demonstrate("a.tsv", 1), demonstrate("b.tsv", 2)]
    return tuple(pair[0] for pair in pairs), tuple(pair[1] for pair in pairs)


def lengths(recordings):
    return tuple(len(recording.time) for recording in recordings)


def test_movements_get_their_names(people):
    recordings, truth = people
    stage = RecognizeConfig(examples_per_class=2)
    model = stage.train(recordings, truth)
    assert sorted(model.labels) == sorted(2 * ["forward", "idle", "left", "up"])
    shares = []
    found = stage.run(recordings, truth, model, Work(progress=shares.append))
    score = score_labels(found, truth, lengths(recordings), model)
    assert score.accuracy == 1.0
    assert score.n_compared > 8
    assert shares == [0.5, 1.0]


def test_distance_tells_the_unknown_from_the_known(people):
    recordings, truth = people
    stage = RecognizeConfig(examples_per_class=4, classes=("forward", "idle"))
    model = stage.train(recordings, truth)
    found = stage.run(recordings, truth, model)[0]
    known = [
        d for d, label in zip(found.distances, truth[0].labels, strict=True) if label == "forward"
    ]
    unknown = [
        d for d, label in zip(found.distances, truth[0].labels, strict=True) if label == "up"
    ]
    assert max(known) < min(unknown)
    learnt = [
        found.distances[k]
        for k, bounds in enumerate(truth[0].bounds.tolist())
        if ("a.tsv", bounds) in list(zip(model.sources, model.bounds.tolist(), strict=True))
    ]
    np.testing.assert_allclose(learnt, 0, atol=1e-12)


def test_the_scale_is_that_of_the_examples_alone(people):
    recordings, truth = people
    model = RecognizeConfig(examples_per_class=3).train(recordings, truth)
    values = model.examples.reshape(len(model.labels), model.recipe.n_points, -1)
    np.testing.assert_allclose(values.mean(axis=(0, 1)), 0, atol=1e-12)
    variance = (values**2).mean(axis=(0, 1))
    widths = count_channels(model.recipe.features, model.recipe.markers)
    sums = [part.sum() for part in np.split(variance, np.cumsum(widths)[:-1])]
    # The box lies still: its speed is the noise alone.
    np.testing.assert_allclose(sums, 1.0)


def test_objects_that_were_seen_throughout_count(people):
    recordings, truth = people
    model = RecognizeConfig().train(recordings, truth)
    assert model.recipe.objects == ("box_back",)
    assert model.recipe.features[-2:] == ("log_object_distance", "log_object_speed")
    assert RecognizeConfig(objects=()).train(recordings, truth).recipe.objects == ()


def test_an_object_with_a_gap_is_left_out(people):
    recordings, truth = people
    positions = recordings[0].positions.copy()
    positions[3, NAMES.index("box_back")] = np.nan
    hidden = LabelledRecording(
        recordings[0].time, positions, NAMES, recordings[0].filled, 50.0, "a.tsv"
    )
    model = RecognizeConfig().train((hidden, recordings[1]), truth)
    assert model.recipe.objects == ()
    assert "log_object_speed" not in model.recipe.features


def test_the_same_seed_gives_the_same_model(people):
    one, other = (RecognizeConfig(seed=4).train(*people) for _ in range(2))
    assert one.examples.tobytes() == other.examples.tobytes()
    assert one.labels == other.labels


def test_recordings_without_truth_teach_nothing(people):
    recordings, truth = people
    model = RecognizeConfig().train(recordings, truth[:1])
    assert set(model.sources) == {"a.tsv"}


def test_segments_without_labels_can_be_named(people):
    recordings, truth = people
    stage = RecognizeConfig()
    model = stage.train(recordings, truth)
    bare = tuple(Segments(t.bounds, -1.0, t.rate_hz, t.source, 7) for t in truth)
    found = stage.run(recordings, bare, model)
    assert found[0].first_frame == 7
    np.testing.assert_array_equal(found[0].bounds, truth[0].bounds)


def test_a_class_without_examples_is_refused(people):
    with pytest.raises(RecognitionError, match="class 'down' has no labelled examples; allowed"):
        RecognizeConfig(classes=("down",)).train(*people)


def test_truth_without_a_recording_is_refused(people):
    recordings, truth = people
    with pytest.raises(RecognitionError, match=r"manual segments of 'b.tsv' have no recording"):
        RecognizeConfig().train(recordings[:1], truth)


def test_no_truth_is_refused(people):
    with pytest.raises(RecognitionError, match="no labelled segments to learn from"):
        RecognizeConfig().train(people[0], ())


def test_config_is_checked():
    with pytest.raises(ValidationError, match="no feature 'speed'; did you mean 'speeds'"):
        RecognizeConfig(features=("speed",))
    with pytest.raises(ValidationError, match="greater than or equal to 1"):
        RecognizeConfig(examples_per_class=0)


@pytest.fixture(scope="module")
def real():
    folder = REAL_DATA / "pick_and_place"
    if not folder.is_dir():
        pytest.skip(f"no real recordings in {folder}; set BESMAN_REAL_DATA")
    from besman.io.recordings.qtm_tsv import read_tsv
    from besman.io.segments_json import read_segments, segments_path

    recordings, truth = [], []
    for path in sorted(folder.glob("*.tsv")):
        raw = read_tsv(path)
        names = tuple(name.lower().replace(" ", "_") for name in raw.names)
        filled = np.zeros(raw.positions.shape[:2], dtype=bool)
        recordings.append(
            LabelledRecording(
                raw.time, raw.positions, names, filled, raw.rate_hz, raw.source, raw.first_frame
            )
        )
        truth.append(read_segments(segments_path(path), raw))
    return tuple(recordings), tuple(truth)


def accuracy(real, seeds=5, **settings):
    """Mean over draws of the accuracy on labelled segments."""
    recordings, truth = real
    values = []
    for seed in range(seeds):
        stage = RecognizeConfig(seed=seed, idle_s=1e5, **settings)
        model = stage.train(recordings, truth)
        found = stage.run(recordings, truth, model)
        values.append(score_labels(found, truth, lengths(recordings), model, idle_s=1e5).accuracy)
    return np.mean(values)


def test_real_movements_are_recognized_as_well_as_measured_before(real):
    assert accuracy(real, objects=(), unknown_factor=None) > 0.95
    assert accuracy(real) > 0.98
    # Some of the known are taken for unknown.
    assert accuracy(real, objects=()) > 0.93
