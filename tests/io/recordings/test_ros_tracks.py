import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from besman.exceptions import RecordingError
from besman.io.recordings.ros_tracks import (
    Track,
    compose_tree,
    find_grid,
    sample_poses,
    sample_values,
)

T0 = 1_700_000_000_000_000_000


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 1000), st.floats(0.0, 0.4))
def test_samples_lie_on_the_lines_between_messages(seed, jitter):
    rng = np.random.default_rng(seed)
    seconds = (np.arange(40) + jitter * rng.uniform(-1, 1, 40)) / 50
    stamps = T0 + np.round(seconds * 1e9).astype(np.int64)
    values = rng.normal(size=40)
    mixed = rng.permutation(40)
    track = Track(stamps[mixed].tolist(), values[mixed].tolist())
    grid = find_grid([track], "a")
    expected = [
        values[k]
        if k == 39
        else values[k] + (values[k + 1] - values[k]) * (at - s[k]) / (s[k + 1] - s[k])
        for s in [(stamps - stamps[0]) * 1e-9]
        for at in grid.time
        for k in [int(np.searchsorted(s, at + 1e-12, side="right")) - 1]
    ]
    np.testing.assert_allclose(sample_values(track, grid), expected, atol=1e-6)


def test_a_pose_between_two_is_on_the_shortest_turn():
    turns = [Rotation.from_rotvec([0, 0, 0.0]), Rotation.from_rotvec([0, 0, 0.4])]
    # The second quaternion has the other sign: the same turn.
    values = [
        (0.0, 0.0, 0.0, *turns[0].as_quat()),
        (1.0, 0.0, 0.0, *(-turns[1].as_quat())),
        (2.0, 0.0, 0.0, *turns[1].as_quat()),
    ]
    slow = Track([T0, T0 + 200_000_000, T0 + 400_000_000], values)
    fast = Track([T0 + k * 100_000_000 for k in range(5)], [0.0] * 5)
    grid = find_grid([slow, fast], "a")
    turned, moved = sample_poses(slow, grid)
    np.testing.assert_allclose(moved[:, 0], [0, 0.5, 1, 1.5, 2], atol=1e-9)
    np.testing.assert_allclose(
        Rotation.from_matrix(turned).as_rotvec()[:, 2], [0, 0.2, 0.4, 0.4, 0.4], atol=1e-9
    )


def test_no_track_that_moves():
    with pytest.raises(RecordingError, match="a: a recording of one frame"):
        find_grid([Track([T0], [1.0]), Track([T0, T0], [1.0, 2.0])], "a")


def test_a_tree_is_the_product_of_its_turns():
    rng = np.random.default_rng(0)
    stamps = [T0 + k * 10_000_000 for k in range(8)]
    tracks = {}
    for name, parent in (("c", "b"), ("a", "lab"), ("b", "a")):
        turns = Rotation.from_rotvec(0.2 * rng.normal(size=(8, 3)))
        values = np.hstack([rng.normal(size=(8, 3)), turns.as_quat()])
        tracks[name] = Track(stamps, values.tolist(), parent)
    found = compose_tree(tracks, find_grid(tracks.values(), "x"), "x")
    for k in range(8):
        pose = np.eye(4)
        for name in "abc":
            step = np.eye(4)
            values = tracks[name].values[k]
            step[:3, :3], step[:3, 3] = Rotation.from_quat(values[3:]).as_matrix(), values[:3]
            pose = pose @ step
            np.testing.assert_allclose(found[name][0][k], pose[:3, :3], atol=1e-9)
            np.testing.assert_allclose(found[name][1][k], pose[:3, 3], atol=1e-9)


def test_few_messages_are_no_long_bag():
    stamps = [T0 + 20_000_000 * row for row in range(30)]
    paused = Track([*stamps, T0 + 1000 * 10**9], [0.0] * 31)
    assert find_grid([paused], "a").time[-1] == pytest.approx(1000.0)
    damaged = Track([*stamps, T0 + 10_000 * 10**9], [0.0] * 31)
    with pytest.raises(RecordingError, match=r"31 messages at 50 Hz over 1e\+04 s; are the times"):
        find_grid([damaged], "a")
