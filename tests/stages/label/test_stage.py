import os
from pathlib import Path

import numpy as np
import pytest
from places import SAMPLE
from pydantic import ValidationError

from besman.config.stage import Work
from besman.exceptions import LabellingError
from besman.geometry.gaps import find_runs
from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import read_recording
from besman.person.marker_set import MarkerSet, load_marker_set
from besman.records import Recording
from besman.stages.label.results import label_results
from besman.stages.label.stage import LabelConfig

REAL = Path(
    os.environ.get("BESMAN_REAL_DATA", Path(__file__).parents[3].parent / "shared" / "data")
)
MARKERS = MarkerSet(
    name="two",
    markers={"elbow": (), "hand": ("Hand top",), "stick": ()},
    required=("elbow", "hand"),
)


def make(names=("Hand top", "Elbow", "ghost", "Stick"), **gaps: slice) -> Recording:
    time = np.arange(200) / 100
    positions = np.sin(time[:, None, None] + np.arange(len(names))[:, None] + np.arange(3))
    for name, gap in gaps.items():
        positions[gap, [n.lower().split()[0] for n in names].index(name)] = np.nan
    return Recording(time, positions, tuple(names), 100.0, "run.tsv", first_frame=690)


def test_markers_in_the_order_of_the_set():
    recording = make()
    (labelled,) = LabelConfig().run((recording,), MARKERS)
    assert labelled.markers == ("elbow", "hand", "stick")
    np.testing.assert_array_equal(labelled.positions, recording.positions[:, [1, 0, 3]])
    assert not labelled.filled.any()
    assert (labelled.rate_hz, labelled.source, labelled.first_frame) == (100, "run.tsv", 690)
    np.testing.assert_array_equal(labelled.time, recording.time)


def test_gap_as_long_as_allowed_is_filled():
    (labelled,) = LabelConfig(longest_gap_s=0.29).run((make(hand=slice(50, 79)),), MARKERS)
    np.testing.assert_array_equal(find_runs(labelled.filled[:, 1]), [[50, 79]])
    np.testing.assert_allclose(labelled.marker("hand"), make().positions[:, 0], atol=1e-4)


def test_longer_gap_in_a_required_marker():
    with pytest.raises(
        LabellingError,
        match=r"^run.tsv: marker 'hand' is not seen in frames 740 to 769 \(0.3 s\); gaps up to "
        r"longest_gap_s = 0.29 s are filled, those of back and hand up to longest_rigid_gap_s from "
        r"their other two markers$",
    ):
        LabelConfig(longest_gap_s=0.29).run((make(hand=slice(50, 80)),), MARKERS)


def test_required_marker_that_is_never_seen():
    with pytest.raises(LabellingError, match="marker 'elbow' is not seen in frames 690 to 889"):
        LabelConfig().run((make(elbow=slice(None)),), MARKERS)


def test_optional_marker_keeps_its_long_gaps():
    (labelled,) = LabelConfig().run((make(stick=slice(50, 100)),), MARKERS)
    np.testing.assert_array_equal(find_runs(np.isnan(labelled.marker("stick")[:, 0])), [[50, 100]])
    (without,) = LabelConfig().run((make(("Hand top", "Elbow")),), MARKERS)
    assert without.markers == ("elbow", "hand")


def test_missing_marker():
    with pytest.raises(LabellingError, match=r"run.tsv: marker 'elbow' of two is not .* got: a"):
        LabelConfig().run((make(("a",)),), MARKERS)


def test_negative_limit():
    with pytest.raises(ValidationError, match="greater than or equal to 0"):
        LabelConfig(longest_gap_s=-1.0)


def test_results_and_progress():
    recordings = (make(hand=slice(50, 60)), make(stick=slice(0, 100)))
    done: list[float] = []
    labelled = LabelConfig().run(recordings, MARKERS, work=Work(progress=done.append))
    assert done == [0.5, 1.0]
    results = label_results(recordings, labelled, MARKERS)
    assert results == {
        "n_recordings": 2,
        "names": [{"recording": "run.tsv", "taken": 3, "found": 0}] * 2,
        "fragments": 9,
        "n_unnamed": 2,
        "named_share": pytest.approx((590 + 500) / (790 + 700)),
        "filled_samples": 10,
        "review": [
            {"recording": "run.tsv", "trajectory": "ghost", "reason": "no marker of two"},
            {"recording": "run.tsv", "trajectory": "ghost", "reason": "no marker of two"},
        ],
    }


@pytest.mark.parametrize(
    "folder",
    [
        SAMPLE,
        pytest.param(
            REAL / "pick_and_place",
            marks=pytest.mark.skipif(
                not REAL.is_dir(), reason="the real recordings are not on this machine"
            ),
        ),
    ],
)
def test_recordings_label_with_the_defaults(folder):
    markers = load_marker_set("right_arm")
    recordings = tuple(map(read_recording, find_recordings([folder])))
    labelled = LabelConfig().run(recordings, markers)
    for recording in labelled:
        required = [recording.markers.index(marker) for marker in markers.required]
        assert np.isfinite(recording.positions[:, required]).all()
    results = label_results(recordings, labelled, markers)
    assert results["named_share"] == 1.0
    assert results["review"] == []


def test_a_longer_gap_of_a_rigid_cluster_is_filled_from_the_other_two():
    whole = read_recording(SAMPLE / "subject1.tsv")
    column = [name.lower().replace(" ", "_") for name in whole.names].index("hand_left")
    positions = np.array(whole.positions)
    rows = slice(300, 300 + round(0.6 * whole.rate_hz))
    positions[rows, column] = np.nan
    hidden = Recording(
        whole.time, positions, whole.names, whole.rate_hz, whole.source, whole.first_frame
    )
    markers = load_marker_set("right_arm")
    (labelled,) = LabelConfig().run((hidden,), markers)
    off = np.linalg.norm(labelled.marker("hand_left") - whole.positions[:, column], axis=1)
    assert off.max() < 0.01  # the skin moves
    np.testing.assert_array_equal(
        find_runs(labelled.filled[:, labelled.markers.index("hand_left")]),
        [[rows.start, rows.stop]],
    )
    with pytest.raises(LabellingError, match=r"'hand_left' is not seen in frames .* \(0.6 s\)"):
        LabelConfig(longest_rigid_gap_s=0.5).run((hidden,), markers)
