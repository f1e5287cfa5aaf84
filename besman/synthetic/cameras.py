"""Simulated cameras: markers hidden by limbs, broken and unnamed trajectories, ghosts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from besman.exceptions import ConfigError
from besman.geometry.gaps import find_runs
from besman.records import Recording
from besman.synthetic.capture import GHOST, Capture

FloatArray = npt.NDArray[np.float64]

_ENOUGH_CAMERAS = 2
_HELD = {("stick", "right_hand")}
_THROWN = {"stick"}
_RANGE_SPREAD = (0.75, 1.25)
_RANGES_M = (2.0, 12.0)
_HALVINGS = 9
_LOOK_EVERY_S = 0.1
_GHOST_LIFE_S = (0.03, 0.5)
_GHOST_DISTANCE_M = (0.03, 0.15)
_GHOST_JITTER_M = 0.002


@dataclass(frozen=True)
class Room:
    """The laboratory and its cameras.

    Attributes
    ----------
    n_cameras : int
        Around the walls below the ceiling, evenly but for a little; at least 2.
    width_m, depth_m : float
        Along x and y.
    height_m : float
        Of the cameras.
    blur_deg : float
        A camera does not tell markers apart that are closer in its view.
    missing_share : float
        Share of the marker samples that are to be unseen. The range within which a camera sees a
        marker is set so that this many are; less cannot be seen than limbs and boxes hide.
    ghosts_per_frame : float
        Mean number of ghosts that are there at a time.
    shortest_frames : int
        Trajectories with fewer frames are not delivered.
    """

    n_cameras: int = 8
    width_m: float = 7.0
    depth_m: float = 6.0
    height_m: float = 2.7
    blur_deg: float = 0.2
    missing_share: float = 0.015
    ghosts_per_frame: float = 0.02
    shortest_frames: int = 3

    def __post_init__(self) -> None:
        if not 2 <= self.n_cameras <= 100:
            raise ConfigError(f"cameras: n_cameras: got {self.n_cameras}, expected 2 to 100")
        if not 0.0 <= self.missing_share < 1.0:
            raise ConfigError(
                f"cameras: missing_share: got {self.missing_share}, expected 0 to below 1"
            )
        if not 0.0 <= self.ghosts_per_frame <= 100.0:
            raise ConfigError(
                f"cameras: ghosts_per_frame: got {self.ghosts_per_frame}, expected 0 to 100"
            )


def place_cameras(room: Room, rng: np.random.Generator) -> FloatArray:
    """Place cameras around the walls, shape (C, 3), metres in the laboratory frame."""
    slots = (np.arange(room.n_cameras) + rng.uniform(-0.25, 0.25, room.n_cameras)) / room.n_cameras
    angle = 2.0 * np.pi * slots
    wall = np.array([room.width_m, room.depth_m]) / 2.0
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    along = direction * np.min(wall / np.maximum(np.abs(direction), 1e-9), axis=1)[:, np.newaxis]
    height = room.height_m + rng.uniform(-0.2, 0.1, room.n_cameras)
    return np.column_stack([along, height])


def see_markers(
    capture: Capture,
    cameras: FloatArray,
    ranges: FloatArray,
    blur_deg: float = Room.blur_deg,
    stride: int = 1,
) -> npt.NDArray[np.bool_]:
    """Tell which markers at least two cameras see.

    Parameters
    ----------
    capture : Capture
        With its true motion.
    cameras : array, shape (C, 3)
        Metres in the laboratory frame.
    ranges : array, shape (C,)
        A camera sees markers no farther away, metres.
    blur_deg : float
        See `Room`.
    stride : int
        Every how many frames to look.

    Returns
    -------
    bool array, shape (T, M)
    """
    from besman.synthetic.occlusion import count_views

    if capture.body is None:
        raise ConfigError(f"{capture.recording.source}: no body, so nothing can hide its markers")
    markers = _canonical(capture.recording)
    limbs, boxes = capture.body.capsules, capture.boxes
    n_samples = len(capture.recording.time)
    centres = np.zeros((n_samples, len(boxes), 3))
    axes = np.zeros((n_samples, len(boxes), 3, 3))
    for index, box in enumerate(boxes):
        centres[:, index], axes[:, index] = box.centre, box.box2lab
    views = count_views(
        np.array(capture.recording.positions[::stride]),
        cameras,
        limbs.starts[::stride],
        limbs.ends[::stride],
        limbs.radii,
        centres[::stride],
        axes[::stride],
        np.array([box.half_m for box in boxes]).reshape(-1, 3),
        np.array([[(marker, limb) in _HELD for limb in limbs.names] for marker in markers]),
        np.deg2rad(blur_deg),
        ranges,
        _ENOUGH_CAMERAS,
    )
    return views >= _ENOUGH_CAMERAS


def find_range(capture: Capture, cameras: FloatArray, shares: FloatArray, room: Room) -> float:
    """Find how far cameras may see so that the wanted share of samples is missing.

    Parameters
    ----------
    capture : Capture
    cameras : array, shape (C, 3)
        Metres in the laboratory frame.
    shares : array, shape (C,)
        How far each camera sees, as a share of the answer.
    room : Room

    Returns
    -------
    float
        Metres. Markers of thrown things do not count: they leave the place that cameras look at.
    """
    stride = max(1, round(_LOOK_EVERY_S * capture.recording.rate_hz))
    body = [marker not in _THROWN for marker in _canonical(capture.recording)]
    there = np.isfinite(capture.recording.positions[::stride, body, 0])
    near, far = _RANGES_M
    missing = {near: 1.0, far: 0.0}
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        seen = see_markers(capture, cameras, middle * shares, room.blur_deg, stride)[:, body]
        missing[middle] = 1.0 - float(seen.sum() / there.sum())
        if missing[middle] > room.missing_share:
            near = middle
        else:
            far = middle
    # A marker may come into view all at once: take the side that is nearer to what is wanted.
    return min(near, far, key=lambda reach: abs(missing[reach] - room.missing_share))


def to_unlabelled(capture: Capture, rng: np.random.Generator, room: Room | None = None) -> Capture:
    """Take the names away: a trajectory for every stretch that was seen, and ghosts.

    Parameters
    ----------
    capture : Capture
        Named and without gaps, with its true motion.
    rng : Generator
        Of cameras, ghosts and the order of trajectories.
    room : Room, optional

    Returns
    -------
    Capture
        Unnamed trajectories in the order in which they appear, and what each of them is.
    """
    room = room or Room()
    recording = capture.recording
    cameras = place_cameras(room, rng)
    # Lenses and exposure differ from camera to camera.
    ranges = rng.uniform(*_RANGE_SPREAD, room.n_cameras)
    ranges *= find_range(capture, cameras, ranges, room)
    seen = see_markers(capture, cameras, ranges, room.blur_deg)
    markers = _canonical(recording)
    pieces = [
        (start, recording.positions[start:stop, column], markers[column])
        for column in range(len(markers))
        for start, stop in find_runs(seen[:, column])
        if stop - start >= room.shortest_frames
    ]
    pieces += _draw_ghosts(recording, room, rng)
    order = np.lexsort((rng.permutation(len(pieces)), np.array([start for start, _, _ in pieces])))
    positions = np.full((len(recording.time), len(pieces), 3), np.nan)
    for column, index in enumerate(order):
        start, path, _ = pieces[index]
        positions[start : start + len(path), column] = path
    return replace(
        capture,
        recording=Recording(
            time=recording.time,
            positions=positions,
            names=(None,) * len(pieces),
            rate_hz=recording.rate_hz,
            source=recording.source,
            first_frame=recording.first_frame,
        ),
        trajectories=tuple(pieces[index][2] for index in order),
    )


def _canonical(recording: Recording) -> list[str]:
    """Canonical names of the markers."""
    return [str(name).lower().replace(" ", "_") for name in recording.names]


def _draw_ghosts(
    recording: Recording, room: Room, rng: np.random.Generator
) -> list[tuple[int, FloatArray, str]]:
    """Draw short-lived ghosts: half beside a marker and following it, half anywhere."""
    n_samples, n_markers = recording.positions.shape[:2]
    mean_life = 0.5 * sum(_GHOST_LIFE_S) * recording.rate_hz
    n_ghosts = rng.poisson(room.ghosts_per_frame * n_samples / mean_life)
    ghosts: list[tuple[int, FloatArray, str]] = []
    for _ in range(n_ghosts):
        life = round(rng.uniform(*_GHOST_LIFE_S) * recording.rate_hz)
        start = int(rng.integers(0, n_samples))
        stop = min(start + max(life, room.shortest_frames), n_samples)
        beside = rng.random() < 0.5
        marker = int(rng.integers(n_markers))
        offset = rng.normal(0.0, 1.0, 3)
        offset *= rng.uniform(*_GHOST_DISTANCE_M) / np.linalg.norm(offset)
        anywhere = rng.uniform(-0.5, 0.5, 3) * [2.0, 2.0, 2.0] + [0.0, 0.0, 1.0]
        path = recording.positions[start:stop, marker] + offset
        if not beside or np.isnan(path).any():
            path = np.tile(anywhere, (stop - start, 1))
        path = path + rng.normal(0.0, _GHOST_JITTER_M, path.shape)
        if stop - start >= room.shortest_frames:
            ghosts.append((start, path, GHOST))
    return ghosts
