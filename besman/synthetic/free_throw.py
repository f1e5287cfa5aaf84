"""A simulated person's free throws with a basketball, as keypoints of a markerless system.

The files have the layout of the SPL open data (basketball/freethrow): a JSON file for each throw,
27 keypoints and the ball for each frame, feet, milliseconds, ``NaN`` where the ball is not seen.
The person bounces the ball, takes it up and throws it; the cameras lose it shortly after.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

GRAVITY = 9.81  # m/s^2
_FOOT_M = 0.3048
# NBA rule 1: the ring's middle and height, seen from the middle of the court, and the ball.
_RING_M = np.array([41.75, 0.0, 10.0]) * _FOOT_M
_RING_RADIUS_IN = 9.0
_BALL_RADIUS_M = 0.12
_STANDS_AT_M = np.array([8.3, 0.0, 0.0])
_UPPER_ARM_M, _FOREARM_M = 0.30, 0.27
_HAND_M = 0.09  # wrist to knuckles
_NOISE_M = 0.004
# Ball and hands when the person takes the ball up, from the middle between the shoulders.
_HOLD, _DIP, _SET = np.array([[0.36, 0.0, -0.38], [0.38, 0.0, -0.45], [0.24, -0.06, 0.22]])
_RELEASE = np.array([0.34, -0.08, 0.56])
# Beginning of: bouncing, holding, dip, rise; and the release, seconds.
_TIMES_S = (0.5, 1.5, 2.2, 2.55, 3.2)
_DURATION_S = 4.6
_SEEN_S = 0.33  # the ball is in the cameras' view after it was let go


@dataclass(frozen=True, eq=False)
class FreeThrow:
    """One throw.

    Attributes
    ----------
    content : dict
        What the file holds.
    release_s : float
        When the ball leaves the hand, seconds.
    release_m, velocity_m_s : array, shape (3,)
        Where, metres in the court's frame, and how fast.
    """

    content: Mapping[str, Any]
    release_s: float
    release_m: FloatArray
    velocity_m_s: FloatArray

    def landing(self, height_m: float = 0.0) -> FloatArray:
        """Return where the ball's centre comes down to a height, metres in the court's frame."""
        rise = self.velocity_m_s[2]
        drop = self.release_m[2] - height_m
        flight = (rise + np.sqrt(rise**2 + 2 * GRAVITY * drop)) / GRAVITY
        down = [0.0, 0.0, GRAVITY / 2]
        landed: FloatArray = (
            self.release_m + flight * self.velocity_m_s - flight**2 * np.array(down)
        )
        return landed

    @property
    def on_ring_in(self) -> tuple[float, float]:
        """Return the file's ``landing_x`` and ``landing_y``, inches from the ring's front."""
        away, left = (self.landing(_RING_M[2]) - _RING_M)[:2] / (_FOOT_M / 12.0)
        return float(-left), float(away + _RING_RADIUS_IN)


def simulate_free_throw(trial: int, seed: int = 0, rate_hz: float = 30.0) -> FreeThrow:
    """Throw once.

    Parameters
    ----------
    trial : int
        Number of the throw; each is a little different.
    seed : int
        Of all throws.
    rate_hz : float
        Frames per second.

    Returns
    -------
    FreeThrow
    """
    rng = np.random.default_rng((seed, trial))
    time = np.arange(round(_DURATION_S * rate_hz)) / rate_hz
    release_s = _TIMES_S[-1] + rng.uniform(-0.05, 0.05)
    times = np.array([*_TIMES_S[:-1], release_s])
    angle = np.radians(rng.uniform(50.0, 56.0))
    chest = _chest(time, times)
    at_release = _STANDS_AT_M + _chest(np.array([release_s]), times)[0] + _RELEASE
    at_release[1] += rng.normal(0.0, 0.02)
    velocity = _velocity_to(_RING_M + rng.normal(0.0, [0.15, 0.08, 0.0]), at_release, angle)
    held = _STANDS_AT_M + chest + _held(time, times, velocity)
    ball = _ball(time, times, held, at_release, velocity)
    points = _body(time, times, chest, held)
    for path in points.values():
        path += rng.normal(0.0, _NOISE_M, path.shape)
    ball += rng.normal(0.0, _NOISE_M, ball.shape)
    ball[time < 0.2] = np.nan
    ball[time > release_s + _SEEN_S + rng.uniform(-0.03, 0.03)] = np.nan
    content = {
        "participant_id": "P0001",
        "trial_id": f"T{trial:04d}",
        "result": "made",
        "tracking": [
            {
                "frame": row,
                "time": int(1000 * row / rate_hz),
                "data": {
                    "ball": _feet(ball[row]),
                    "player": {name: _feet(path[row]) for name, path in points.items()},
                },
            }
            for row in range(len(time))
        ],
    }
    return FreeThrow(content, float(release_s), at_release, velocity)


def _feet(position: FloatArray) -> list[float]:
    return [round(float(one), 3) for one in position / _FOOT_M]


def _velocity_to(place: FloatArray, start: FloatArray, angle_rad: float) -> FloatArray:
    """Return the velocity with which a ball thrown at an angle comes down through a place, m/s."""
    way = place - start
    far = float(np.hypot(way[0], way[1]))
    across = far * np.sqrt(GRAVITY / (2 * (far * np.tan(angle_rad) - way[2])))
    return np.array([*(across * way[:2] / far), across * np.tan(angle_rad)])


def _path(
    times: npt.ArrayLike, places: FloatArray, speeds: FloatArray, at: FloatArray
) -> FloatArray:
    """Move smoothly through places with given velocities, at rest before and after."""
    from scipy.interpolate import BPoly

    none = np.zeros_like(places)
    curve = BPoly.from_derivatives(times, np.stack([places, speeds, none], axis=1))
    path: FloatArray = curve(np.clip(at, np.min(times), np.max(times)))
    return path


def _chest(time: FloatArray, times: FloatArray) -> FloatArray:
    """Return the middle between the shoulders, (T, 3): it sinks before the throw, and rises."""
    heights = np.array([1.42, 1.42, 1.22, 1.50, 1.42])
    at = [times[1], times[2], times[3] + 0.05, times[4] + 0.02, times[4] + 0.4]
    places = np.column_stack([np.zeros(5), np.zeros(5), heights])
    return _path(at, places, np.zeros_like(places), time)


def _held(time: FloatArray, times: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return the middle of the hold, (T, 3), from the middle between the shoulders."""
    ready = times[4] - 0.25
    places = np.array([_HOLD, _HOLD, _DIP, _SET, _RELEASE, [0.42, -0.08, 0.50], [0.1, 0.0, -0.5]])
    speeds = np.zeros_like(places)
    speeds[3] = [0.1, 0.0, 1.2]
    # The fingers give the ball the rest of its speed.
    speeds[4] = 0.35 * velocity - [0.0, 0.0, 0.2]
    at = [times[1], times[2], times[3], ready, times[4], times[4] + 0.35, times[4] + 0.95]
    return _path(at, places, speeds, time)


def _ball(
    time: FloatArray, times: FloatArray, held: FloatArray, start: FloatArray, velocity: FloatArray
) -> FloatArray:
    """Return the ball's centre, (T, 3): bounced twice, held, thrown."""
    ball: FloatArray = held + np.array([0.03, 0.0, 0.06])
    bouncing = (time > times[0]) & (time < times[1])
    phase = 2 * (time[bouncing] - times[0]) / (times[1] - times[0]) % 1.0
    top = ball[bouncing, 2] - 0.1
    ball[bouncing, 2] = top - (top - _BALL_RADIUS_M) * (1 - np.abs(2 * phase - 1)) ** 0.8
    since = time - times[4]
    flying = since > 0
    path = start + np.outer(since, velocity) - np.outer(since**2, [0.0, 0.0, GRAVITY / 2])
    ball[flying] = path[flying]
    return ball


def _body(
    time: FloatArray, times: FloatArray, chest: FloatArray, held: FloatArray
) -> dict[str, FloatArray]:
    """Return the 27 keypoints, each (T, 3), metres in the court's frame."""
    body = _STANDS_AT_M + chest
    hips = body * [1, 1, 0] + np.column_stack([0 * time, 0 * time, 0.62 * chest[:, 2]])
    points: dict[str, FloatArray] = {}
    for name, place in (("EYE", [0.09, 0.03, 0.22]), ("EAR", [0.0, 0.07, 0.21])):
        points[f"L_{name}"] = body + place
        points[f"R_{name}"] = body + np.array(place) * [1, -1, 1]
    points["NOSE"] = body + np.array([0.12, 0.0, 0.18])
    bounced = np.clip((time - times[0]) / (times[1] - times[0]), 0, 1)
    dribble = 0.25 * np.sin(2 * np.pi * bounced) ** 2
    leaves = 1 / (1 + np.exp(-(time - times[4] + 0.02) / 0.03))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        shoulder = body + np.array([0.0, 0.19, 0.0]) * [1, sign, 1]
        grip = held + np.array([0.0, 0.11, 0.0]) * [1, sign, 1]
        if side == "R":
            grip = grip - np.outer(dribble, [0.0, 0.0, 1.0])
        else:
            # The guiding hand stays behind when the ball goes.
            grip = grip - np.outer(leaves, [0.12, -0.05, 0.15])
        points |= _arm(shoulder, grip, side, sign)
        points |= _leg(hips + np.array([0.0, 0.11, 0.0]) * [1, sign, 1], side, sign)
    return points


def _arm(shoulder: FloatArray, grip: FloatArray, side: str, sign: float) -> dict[str, FloatArray]:
    """Return an arm whose wrist is below the place where the hand holds."""
    along = np.array([0.35, -0.2 * sign, 0.9]) / np.linalg.norm([0.35, 0.2, 0.9])
    way = grip - _HAND_M * along - shoulder
    far = np.linalg.norm(way, axis=1, keepdims=True)
    reach = np.minimum(far, 0.985 * (_UPPER_ARM_M + _FOREARM_M))
    unit = way / far
    wrist = shoulder + reach * unit
    share = (_UPPER_ARM_M**2 - _FOREARM_M**2 + reach**2) / (2 * reach)
    out = np.array([0.5, 0.3 * sign, -1.0])
    pole = out - (unit @ out)[:, None] * unit
    pole /= np.linalg.norm(pole, axis=1, keepdims=True)
    elbow = shoulder + share * unit + np.sqrt(np.maximum(_UPPER_ARM_M**2 - share**2, 0.0)) * pole
    knuckles = wrist + _HAND_M * along
    across = np.array([-0.03, -0.025 * sign, 0.012])
    return {
        f"{side}_SHOULDER": shoulder.copy(),
        f"{side}_ELBOW": elbow,
        f"{side}_WRIST": wrist,
        f"{side}_1STFINGER": knuckles + across,
        f"{side}_5THFINGER": knuckles - across,
    }


def _leg(hip: FloatArray, side: str, sign: float) -> dict[str, FloatArray]:
    """Return a leg that stands; its knee bends as the hip sinks."""
    foot = _STANDS_AT_M + np.array([0.0, 0.12 * sign, 0.0])
    knee = (hip + foot) / 2 + np.outer(np.sqrt(np.maximum(0.02, 1.0 - hip[:, 2])), [0.22, 0, 0])
    places = {
        "ANKLE": [0.0, 0.0, 0.09],
        "1STTOE": [0.17, -0.02 * sign, 0.02],
        "5THTOE": [0.13, 0.05 * sign, 0.02],
        "CALC": [-0.05, 0.0, 0.03],
    }
    still = np.zeros_like(hip)
    return {
        f"{side}_HIP": hip.copy(),
        f"{side}_KNEE": knee,
        **{f"{side}_{name}": still + foot + place for name, place in places.items()},
    }
