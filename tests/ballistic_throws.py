"""Throws without an arm: points are changes of release velocity."""

from types import SimpleNamespace

import numpy as np

from besman.simulation.tasks.stick_throw.throw_and_flight import ballistic_touchdown
from besman.transfer.archive import Archive

RELEASE = np.array([0.3, 0.1, 1.2])
DIMENSION = 8
# Velocities that the coordinates change, with some that change nothing.
MIXING = np.random.default_rng(5).normal(0, 0.45, (3, DIMENSION))
MIXING[:, 5:] = 0.0
REWARD = SimpleNamespace(miss_per_m=1.0, failure=5.0)


def velocities(points):
    return np.array([1.5, 0.5, 1.0]) + np.asarray(points) @ MIXING.T


class BallSimulator:
    """Flights from one place; no throw where the ball goes down at once."""

    space = SimpleNamespace(dimension=DIMENSION)
    task = SimpleNamespace(reward=REWARD, success_radius_m=0.05)

    def __init__(self):
        self.n = 0

    def simulate(self, points, jobs=1):
        self.n += len(points)
        velocity = velocities(points)
        places = np.tile(RELEASE, (len(points), 1))
        landed = ballistic_touchdown(places, velocity)[:, :2]
        failed = velocity[:, 2] < 0.3
        landed[failed] = np.nan
        releases = np.concatenate([places, velocity], axis=1)
        releases[failed] = np.nan
        return Archive(np.array(points), landed, releases, np.where(failed, 10.0, 0.0))


def real(points, gain):
    return ballistic_touchdown(RELEASE, gain * velocities(points) + [0.1, -0.15, 0.0])[:2]


TARGET = ballistic_touchdown(RELEASE, velocities(np.zeros(DIMENSION)))[:2]
