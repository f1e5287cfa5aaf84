"""What would stop a run is said before it, in its words."""

import json

import pytest
from command_line import besman

from besman.config.resources import find_resource
from besman.exceptions import BesmanError
from besman.io.recordings.formats import read_recording, write_recording
from besman.pipeline.check import check_pipeline
from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.synthetic.datasets import write_synthetic

STICK_THROW = str(find_resource("pipelines", "ur5_stick_throw"))
TINY = (
    "recognize.examples_per_class=1", "map.evaluations=2", "map.yaw=false", "refine.episodes=1",
)  # fmt: skip


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """Two throws with names; and the same without the elbow, without the stick."""
    folder = tmp_path_factory.mktemp("capture")
    write_synthetic("stick_throw", folder / "whole", n_subjects=1, n_repetitions=2)
    whole = read_recording(folder / "whole" / "subject1.tsv")
    (folder / "no_back.yaml").write_text(
        "name: no_back\nmarkers: {hand_top: [], hand_left: [], hand_right: [], elbow: []}\n"
        "required: [hand_top]\nroles: {hand: hand_top}\n"
    )
    for name in ("elbow", "stick"):
        (folder / name).mkdir()
        kept = [k for k, called in enumerate(whole.names) if called.lower() != name]
        part = type(whole)(
            whole.time, whole.positions[:, kept], tuple(whole.names[k] for k in kept),
            whole.rate_hz, whole.source, whole.first_frame,
        )  # fmt: skip
        write_recording(part, folder / name / "subject1.tsv")
        segments = "subject1_manually_segmented.json"
        content = json.loads((folder / "whole" / segments).read_text())
        # It says of the whole recording, of which this one is not.
        del content["recording"]
        (folder / name / segments).write_text(json.dumps(content))
    return folder


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """One run folder: what stages have in common is computed once."""
    return tmp_path_factory.mktemp("run")


STOPS = {
    "a marker that the set needs": ("elbow", (), "marker 'elbow' of right_arm is not there"),
    "a marker set that does not fit": (
        "whole", ("label.markers=two_arms",), "marker 'left_shoulder' of two_arms is not there",
    ),
    "a marker set without a back": (
        "whole", ("label.markers={capture}/no_back.yaml", "select.object=null"),
        "no marker 'back_top': the person's frame needs back_top, back_left",
    ),
    "no marker of what is thrown": ("stick", (), "the recording has no marker 'stick' of a thrown"),
    "a target that nothing gives": (
        "whole", ("select.object=null",), "task stick_throw needs a target on the floor",
    ),
    "a tool that the robot lacks": ("whole", ("tool=stick",), "no tool 'stick'; did you mean"),
    "a tool that is not the task's": (
        "whole", ("tool=gripper",), "task stick_throw: robot ur5 carries tool 'gripper', expected",
    ),
}  # fmt: skip


@pytest.mark.parametrize("stop", STOPS)
def test_check_says_what_run_will_say(stop, capture, out, monkeypatch, capsys):
    folder, settings, words = STOPS[stop]
    settings = tuple(one.replace("{capture}", str(capture)) for one in settings)
    settings = (f"recordings={capture / folder}", *TINY, *settings)
    arguments = [part for setting in settings for part in ("--set", setting)]
    assert besman(monkeypatch, "check", STICK_THROW, *arguments) == 2
    said = capsys.readouterr().err.strip().removeprefix("besman: error: ")
    assert words in said
    assert "\n" not in said
    with pytest.raises(BesmanError) as caught:
        run_pipeline(load_pipeline(find_resource("pipelines", "ur5_stick_throw"), settings), out)
    assert said.removeprefix("every motion: ") in str(caught.value)


def test_a_second_arm_is_looked_at_too():
    arms = ("second_arm={robot: ur5, tool: nope}", "tool=stick_holder")
    with pytest.raises(BesmanError, match="no tool 'nope'"):
        check_pipeline("ur5_stick_throw", arms)
    # Nothing is thrown with it.
    arms = ("second_arm={robot: ur5, tool: stick_holder}",)
    with pytest.raises(BesmanError, match="task stick_throw needs a target on the floor"):
        check_pipeline("ur5_stick_throw", arms)
    lines = check_pipeline("ur10_lever", ("second_arm={robot: ur10, tool: hook}",))
    assert "second arm: ur10 with hook, 6 joints" in lines


def test_recordings_without_what_is_thrown_are_listed(capture, tmp_path):
    other = read_recording(capture / "whole" / "subject1.tsv")
    write_recording(other, tmp_path / "b.tsv")
    settings = (f"recordings=[{capture / 'stick'}, {tmp_path}]",)
    lines = check_pipeline(STICK_THROW, settings)
    assert "without marker stick of a thrown object: subject1.tsv" in lines


def test_training_recordings_are_labelled_too(capture):
    settings = (f"recordings={capture / 'whole'}", f"training={capture / 'elbow'}")
    with pytest.raises(BesmanError, match="marker 'elbow' of right_arm is not there"):
        check_pipeline(STICK_THROW, settings)
    lines = check_pipeline(STICK_THROW, (settings[0], f"training={capture / 'stick'}"))
    assert "training: 1 recordings, all markers of right_arm there" in lines


@pytest.mark.parametrize("name", ["ball_throw", "grasp_box", "lever", "reach"])
def test_other_tasks_bring_their_targets(name, capture):
    tool = {"ball_throw": "scoop", "grasp_box": "gripper3", "lever": "hook", "reach": "gripper"}
    task = {"lever": "pull_lever"}.get(name, name)
    settings = (f"recordings={capture / 'whole'}", f"task={task}", f"tool={tool[name]}")
    assert check_pipeline(STICK_THROW, (*settings, "select.object=null"))[-1].startswith("task: ")
