import sys

import numpy as np
import pytest

from besman.cli import main as cli
from besman.exceptions import RenderingError, RunError
from besman.pictures import rendering
from besman.records.files import load_record
from besman.report import video
from besman.report.panels import BAND, join_panels, text_band
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_task

imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")


@pytest.fixture(scope="module")
def motions(small_run):
    return load_record(next(small_run.glob("*_refine")) / "record.npz")


def can_draw():
    try:
        video.check_video()
    except RenderingError:
        return False
    return True


def test_a_video_has_room_for_up_to_three_panels():
    height = 448 + 2 * BAND
    assert [video._size(n) for n in (1, 2, 3)] == [(640, height), (1280, height), (1296, height)]


@pytest.mark.slow
def test_a_video_has_its_size_its_frames_and_something_that_moves(
    small_run, motions, tmp_path, monkeypatch
):
    # A third as wide and high: without graphics hardware drawing is what takes time.
    monkeypatch.setattr(video, "_WIDTHS", {1: 208, 2: 208, 3: 144})
    monkeypatch.setattr(video, "_HEIGHT", 144)
    # And a quarter as many pictures: shown at double speed.
    assert video._SPEED == 0.5
    monkeypatch.setattr(video, "_SPEED", 2.0)
    motion = max(motions, key=lambda one: len(one.milestones))
    out = tmp_path / "new" / "throw.mp4"
    done = []
    if not can_draw():
        with pytest.raises(RenderingError, match="libegl1"):
            video.write_video(small_run, motion.plan.name, out)
        return
    path = video.write_video(small_run, motion.plan.name, out, progress=done.append)
    assert path == out
    assert done == sorted(done)
    assert done[-1] == 1.0
    reader = imageio_ffmpeg.read_frames(str(out))
    about = next(reader)
    shown = video._shown(motion)
    n = len(shown)
    width = {1: 208, 2: 416, 3: 432}[n]
    assert about["size"] == (width, 144 + 2 * BAND)
    assert about["fps"] == 25
    frames = [np.frombuffer(frame, np.uint8).reshape(-1, width, 3) for frame in reader]
    robot, task = load_robot("ur5", "stick_holder"), load_task("stick_throw")
    longest = max(len(task.play(robot, plan).states) for _, plan in shown)
    shown_s = len(frames) / 25 - 1.2
    assert shown_s == pytest.approx(longest * task.simulation.time_step_s / 2, abs=0.05)
    moved = np.abs(frames[0].astype(int) - frames[-1])[BAND:-BAND]
    assert moved.max() > 100
    # Every panel moves, and the last pictures stand still.
    for panel in np.split(moved, n, axis=1):
        assert (panel.max(axis=2) > 60).mean() > 0.001
    assert np.abs(frames[-1].astype(int) - frames[-20])[BAND:-BAND].mean() < 1


def test_captions_say_episode_and_miss(motions):
    robot, task = load_robot("ur5", "stick_holder"), load_task("stick_throw")
    for motion in motions:
        captions = [
            video._caption(motion, index, robot, task) for index in range(len(video._shown(motion)))
        ]
        assert captions[0].startswith("imitated · episode 0 · ")
        if len(captions) > 1:
            episode = motion.milestones[-1][0]
            assert f" · episode {episode} · miss {100 * motion.miss:.1f} cm" in captions[-1]


def test_panels_stand_side_by_side():
    panels = [np.full((20, 40, 3), shade, np.uint8) for shade in (10, 200)]
    captions = [text_band(40, "one"), text_band(40, "two")]
    picture = join_panels(panels, captions, text_band(80, "both, in many more words than fit"))
    assert picture.shape == (20 + 2 * BAND, 80, 3)
    assert (picture[BAND:-BAND, :40] == 10).all()
    assert (picture[BAND:-BAND, 42:] == 200).all()
    assert captions[0].min() < 80
    assert picture[:BAND, 42:].min() < 80


def besman(*arguments):
    patch = pytest.MonkeyPatch()
    patch.setattr("sys.argv", ["besman", *map(str, arguments)])
    try:
        with pytest.raises(SystemExit) as caught:
            cli.main()
    finally:
        patch.undo()
    return caught.value.code or 0


def test_without_the_encoder_the_command_says_what_to_install(small_run, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert besman("video", small_run) == 2
    said = capsys.readouterr().err
    assert "video: imageio-ffmpeg is not installed; pip install 'besman[video]'" in said
    assert "Traceback" not in said


def test_an_encoder_that_does_not_start_is_said_with_its_reason(small_run, monkeypatch, capsys):
    def refuse():
        raise RuntimeError("No ffmpeg exe could be found.\nInstall ffmpeg, or set a variable.")

    monkeypatch.setattr("imageio_ffmpeg.get_ffmpeg_exe", refuse)
    assert besman("video", small_run) == 2
    said = capsys.readouterr().err
    assert "video: no ffmpeg: No ffmpeg exe could be found. Install ffmpeg, or set a" in said


def test_graphics_that_do_not_start_are_said_with_their_reason():
    error = RuntimeError("EGLError(\n\terr = EGL_NOT_INITIALIZED,\n\tresult = 0\n)")
    said = str(rendering._cannot(error))
    assert "(EGL: EGLError( err = EGL_NOT_INITIALIZED, result = 0 )); expected" in said


def test_without_graphics_the_command_says_so_before_a_run(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mujoco.egl", None)
    assert besman("run", "ur5_stick_throw", "--out", tmp_path / "run", "--video") == 2
    said = capsys.readouterr().err
    assert "video: this machine cannot draw without a screen (EGL: " in said
    assert "libegl1" in said
    assert not (tmp_path / "run").exists()


def test_without_graphics_no_file_is_left(small_run, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mujoco.egl", None)
    assert besman("video", small_run) == 2
    assert "cannot draw without a screen" in capsys.readouterr().err
    assert not list(small_run.glob("*.mp4"))


def test_wrong_names(small_run, tmp_path):
    with pytest.raises(RunError, match=r"--motion: no motion 'subject1.tsv:99'; .*subject1\.tsv:2"):
        video.write_video(small_run, "subject1.tsv:99")
    with pytest.raises(RenderingError, match=r"--out: got .*a\.avi, expected a name .* in \.mp4"):
        video.write_video(small_run, out=tmp_path / "a.avi")
    with pytest.raises(RunError, match=r"not a run: pipeline\.yaml is missing"):
        video.write_video(tmp_path)
    with pytest.raises(RunError, match=r"no refined motions \(refine_second\) to show"):
        video.write_video(small_run, second_arm=True)
    with pytest.raises(RunError, match="no motion was refined"):
        video._choose((), None)


def test_a_file_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    picture = np.zeros((32, 32, 3), np.uint8)
    with pytest.raises(RenderingError, match="cannot be written"):
        video._write(iter([picture]), (32, 32), tmp_path / "file" / "a.mp4")


def test_a_video_without_its_end_is_not_taken_for_whole(tmp_path, monkeypatch):
    monkeypatch.setattr("imageio_ffmpeg.count_frames_and_secs", lambda path: (1, 0.1))
    pictures = [np.zeros((32, 32, 3), np.uint8)] * 2
    with pytest.raises(RenderingError, match=r"a\.mp4: cannot be written: ffmpeg ended before the"):
        video._write(iter(pictures), (32, 32), tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())
