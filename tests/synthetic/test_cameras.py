from dataclasses import replace

import numpy as np
import pytest

from besman.exceptions import ConfigError
from besman.geometry.gaps import find_runs
from besman.synthetic.cameras import Room, place_cameras, see_markers, to_unlabelled
from besman.synthetic.capture import GHOST
from besman.synthetic.datasets import captures
from besman.synthetic.occlusion import count_views

FAR = np.full(8, 50.0)


@pytest.fixture(scope="module")
def capture():
    (one,) = captures("pick_and_place", 1, 1, seed=2)
    return one


def free_by_sampling(point, camera, limbs, row, box):
    """Sample the line of sight finely; also return how close it came to deciding otherwise."""
    line = camera + np.linspace(0, 1, 1501)[:, np.newaxis] * (point - camera)
    axis = limbs.ends[row] - limbs.starts[row]
    share = np.einsum("kj,skj->sk", axis, line[:, np.newaxis] - limbs.starts[row])
    share = np.clip(share / (axis**2).sum(axis=1), 0, 1)
    nearest = limbs.starts[row] + share[..., np.newaxis] * axis
    gap = (np.linalg.norm(line[:, np.newaxis] - nearest, axis=2) - limbs.radii).min()
    inside = (line - box.centre[row]) @ box.box2lab[row]
    box_gap = (np.abs(inside) - box.half_m).max(axis=1).min()
    closest = min(gap, box_gap)
    return closest > 0, abs(closest)


def test_sight_is_what_sampling_the_lines_of_sight_says(capture):
    rng = np.random.default_rng(0)
    cameras = place_cameras(Room(), rng)
    box = capture.boxes[0]
    limbs = capture.body.capsules
    compared = hidden = 0
    for row in rng.integers(0, len(capture.recording.time), 10):
        cut = slice(row, row + 1)
        points = capture.recording.positions[cut]
        for camera in cameras:
            views = count_views(
                np.array(points),
                camera[np.newaxis],
                limbs.starts[cut],
                limbs.ends[cut],
                limbs.radii,
                box.centre[cut, np.newaxis],
                box.box2lab[cut, np.newaxis],
                box.half_m[np.newaxis],
                np.zeros((points.shape[1], len(limbs.radii)), bool),
                0.0,
                FAR[:1],
                1,
            )[0]
            for marker, view in enumerate(views):
                free, margin = free_by_sampling(points[0, marker], camera, limbs, row, box)
                if margin > 0.002:
                    assert bool(view) == free
                    compared += 1
                    hidden += not free
    assert compared > 800
    assert hidden > 150


def test_more_cameras_see_no_less(capture):
    cameras = place_cameras(Room(), np.random.default_rng(1))
    few, all_of_them = (see_markers(capture, cameras[:n], FAR[:n]) for n in (5, 8))
    assert (few <= all_of_them).all()
    assert few.sum() < all_of_them.sum()


def test_markers_of_a_limb_are_outside_of_it():
    for name in ("lever", "object_rotation"):
        (one,) = captures(name, 1, 1)
        limbs = one.body.capsules
        for column in range(one.recording.positions.shape[1]):
            for limb in range(len(limbs.radii)):
                axis = limbs.ends[:, limb] - limbs.starts[:, limb]
                off = one.recording.positions[:, column] - limbs.starts[:, limb]
                share = np.clip((off * axis).sum(axis=1) / (axis**2).sum(axis=1), 0, 1)
                gap = np.linalg.norm(off - share[:, np.newaxis] * axis, axis=1)
                assert gap.min() > limbs.radii[limb], (one.recording.names[column], limb)


def test_names_are_gone_and_the_truth_brings_them_back(capture):
    unnamed = to_unlabelled(capture, np.random.default_rng(3), Room(ghosts_per_frame=0.2))
    recording = unnamed.recording
    assert set(recording.names) == {None}
    assert len(unnamed.trajectories) == recording.positions.shape[1]
    known = [str(name).lower().replace(" ", "_") for name in capture.recording.names]
    together = np.zeros((len(recording.time), len(known)), int)
    starts = []
    for column, name in enumerate(unnamed.trajectories):
        seen = np.isfinite(recording.positions[:, column, 0])
        runs = find_runs(seen)
        assert len(runs) == 1  # a trajectory ends at its first gap
        starts.append(runs[0][0])
        if name != GHOST:
            together[seen, known.index(name)] += 1
            np.testing.assert_array_equal(
                recording.positions[seen, column],
                capture.recording.positions[seen, known.index(name)],
            )
    assert together.max() == 1
    assert starts == sorted(starts)
    assert 0.85 < together.mean() < 1
    assert unnamed.trajectories.count(GHOST) > 3
    assert unnamed.segments is capture.segments


def test_the_same_random_numbers_give_the_same_cameras(capture):
    one, two = (to_unlabelled(capture, np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(one.recording.positions, two.recording.positions)
    assert one.trajectories == two.trajectories


def test_more_can_be_missing():
    (one,) = captures("ball_throw", 1, 3)
    shares = []
    for share in (0.0, 0.05, 0.15):
        room = Room(missing_share=share, ghosts_per_frame=0)
        unnamed = to_unlabelled(one, np.random.default_rng(0), room)
        seen = np.isfinite(unnamed.recording.positions[..., 0]).sum()
        shares.append(1 - seen / one.recording.positions[..., 0].size)
    assert shares[0] < 0.01
    assert shares[0] < shares[1] < shares[2]
    assert shares[2] == pytest.approx(0.15, abs=0.05)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n_cameras": 1}, "cameras: n_cameras: got 1, expected 2 to 100"),
        ({"ghosts_per_frame": -1}, "cameras: ghosts_per_frame: got -1"),
        ({"missing_share": 1.0}, "cameras: missing_share: got 1.0"),
    ],
)
def test_rooms_that_cannot_be(arguments, message):
    with pytest.raises(ConfigError, match=message):
        Room(**arguments)


def test_without_a_body_nothing_hides(capture):
    with pytest.raises(ConfigError, match="no body"):
        see_markers(replace(capture, body=None), np.zeros((2, 3)), FAR[:2])
