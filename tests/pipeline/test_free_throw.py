"""Real people's throws, one a recording: from a folder of keypoint files to throws that hit."""

import json

import numpy as np
import pytest
from free_throws import with_landing, write_throws
from places import TOP

from besman.exceptions import ConfigError, RecordingWarning, RefinementError, RunError
from besman.following.plans import make_plan
from besman.pipeline.check import check_pipeline
from besman.pipeline.config import load_pipeline
from besman.pipeline.finished_run import read_run
from besman.pipeline.pipeline import run_pipeline
from besman.standalone.look_files import look_at
from besman.standalone.look_text import describe_look

RECIPE = TOP / "pipelines" / "ur5_free_throw.yaml"
pytestmark = pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")


def of_2025(content):
    """Spell the keypoints as the later session does: whole words, and fingers never seen."""
    whole = {"R_": "RIGHT_", "L_": "LEFT_"}
    ends = {"1STFINGER": "THUMB", "5THFINGER": "PINKY", "1STTOE": "BIG_TOE", "CALC": "HEEL"}

    def spell(name):
        name = whole.get(name[:2], name[:2]) + name[2:]
        head, _, end = name.rpartition("_")
        return f"{head}_{ends[end]}" if end in ends else name

    unseen = {f"{side}_SECOND_FINGER_MCP": [None] * 3 for side in ("RIGHT", "LEFT")}
    tracking = [
        {
            **frame,
            "data": {
                "ball": frame["data"]["ball"],
                "player": {spell(name): at for name, at in frame["data"]["player"].items()}
                | unseen
                | {"MID_HIP": [None] * 3},
            },
        }
        for frame in content["tracking"]
    ]
    return {"sampling_rate": 60, **content, "tracking": tracking}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("free_throws")
    write_throws(path, 2)
    return path


def settings(folder, *more):
    return (f"recordings={folder}", *more)


def test_check_says_what_tells_the_targets(folder):
    lines = check_pipeline(str(RECIPE), settings(folder))
    assert "target: by object, else flight, else release" in lines
    assert "recognition: one throw in each recording" in lines
    assert any(line.startswith("recordings: 2, 9 s, all markers of spl there") for line in lines)


def test_both_spellings_of_the_keypoints_are_known(tmp_path):
    write_throws(tmp_path, 1, of_2025, rate_hz=60.0)
    lines = check_pipeline(str(RECIPE), settings(tmp_path))
    assert any("all markers of spl there" in line for line in lines)


def test_check_names_what_a_landing_file_lacks(folder, tmp_path):
    landings = tmp_path / "landings.csv"
    landings.write_text("recording,x_m,y_m\nBB_FT_P0001_T0001,12,0\n")
    lines = check_pipeline(str(RECIPE), settings(folder, f"select.landing={landings}"))
    assert "target: by landing, else object, else flight, else release" in lines
    assert "without a landing: BB_FT_P0001_T0002.json" in lines
    landings.write_text("recording,x_m,y_m\nBB_FT_P0001_T0009,12,0\n")
    with pytest.raises(ConfigError, match=r"a landing for none of the recordings; did you mean"):
        check_pipeline(str(RECIPE), settings(folder, f"select.landing={landings}"))


def test_a_landing_of_the_recordings_own_file_counts_first(tmp_path):
    _, throw = write_throws(tmp_path, 2)
    path = tmp_path / "BB_FT_P0001_T0002.json"
    path.write_text(json.dumps(with_landing(throw)))
    lines = check_pipeline(str(RECIPE), settings(tmp_path))
    assert "target: by landing, else object, else flight, else release" in lines
    assert "without a landing: BB_FT_P0001_T0001.json" in lines
    x, y, z = throw.landing(3.048)
    expected = f"on an NBA court: at {x:.2f}, {y:.2f}, {z:.2f} m"
    assert any(expected in line for line in describe_look(look_at(path), []))


def test_a_throw_that_nothing_tells_is_refused_beforehand(folder):
    with pytest.raises(RefinementError, match=r"needs a target on the floor \(.*select\.target"):
        check_pipeline(str(RECIPE), settings(folder, "select.object=null"))
    more = ("select.target=landing",)
    with pytest.raises(ConfigError, match=r"target: landing needs select\.landing"):
        check_pipeline(str(RECIPE), settings(folder, *more))


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("select.label=toss", r"select\.label: got 'toss'; .*throw"),
        ("compose.levels=[]", "compose"),
    ],
)
def test_what_needs_examples_is_refused(folder, setting, message):
    with pytest.raises(ConfigError, match=message):
        load_pipeline(RECIPE, settings(folder, setting))


def test_from_files_to_throws_that_hit(folder, tmp_path, undrawn):
    config = load_pipeline(RECIPE, settings(folder, "map.evaluations=60", "refine.robustness=null"))
    run = run_pipeline(config, tmp_path / "run")
    results = json.loads((run / "results.json").read_text())
    assert results["recognize"]["counts"]["throw"] == 2
    assert set(results["select"]["target"].values()) <= {"object", "flight"}
    assert results["refine"]["n_success"] == 2
    for motion in read_run(run).motions:
        # A quarter of a free throw's six metres, and on the floor.
        assert motion.plan.target[2] == 0.0
        assert 0.5 < np.linalg.norm(motion.plan.target[:2]) < 4.0
    with pytest.raises(RunError, match="one_throw looks at whole recordings"):
        make_plan(run, ())


def test_a_landing_file_among_the_recordings_is_no_recording(folder, tmp_path):
    write_throws(tmp_path, 1)
    landings = tmp_path / "landings.json"
    content = {"units": "m", "landings": {"BB_FT_P0001_T0001": [12.0, 0.0]}}
    landings.write_text(json.dumps(content))
    lines = check_pipeline(str(RECIPE), settings(tmp_path, f"select.landing={landings}"))
    assert any(line.startswith("recordings: 1, ") for line in lines)


def test_the_units_are_said(folder):
    with pytest.warns(RecordingWarning, match="taken for ft, by the size of a person"):
        check_pipeline(str(RECIPE), settings(folder))
