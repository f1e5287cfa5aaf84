"""Two dynamical movement primitives in sequence, joined at a subgoal at speed (thesis 4.4.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import ConfigError
from besman.records import LabelledRecording, LabelledSegments

FloatArray = npt.NDArray[np.float64]

SUBGOALS_M = ((0.6, 0.7), (0.4, 0.6), (0.7, 0.3))
GOAL_M = (1.0, 1.0)
N_DEMONSTRATIONS = 3

_ALPHA = 25.0
_BETA = _ALPHA / 4.0
_LAST_PHASE = 0.01
_N_WEIGHTS = 10
# The forcing term bends the reference by a few percent of the way.
_WEIGHT_SCALE = 5.0
_SUBSTEPS = 4


@dataclass(frozen=True, eq=False)
class SequencedDmps:
    """A planar movement of two DMPs.

    Attributes
    ----------
    positions : array, shape (T, 2)
        Metres.
    border : int
        First sample of the second DMP.
    rate_hz : float
        Samples per second.
    subgoal : int
        Which of `SUBGOALS_M` it passes.
    name : str
        For example ``subgoal1_demonstration2``.
    """

    positions: FloatArray
    border: int
    rate_hz: float
    subgoal: int
    name: str

    def recording(self) -> LabelledRecording:
        """Return the movement as one of the hand, in the plane z = 0."""
        positions = np.pad(self.positions, ((0, 0), (0, 1)))[:, np.newaxis]
        return LabelledRecording(
            time=np.arange(len(positions)) / self.rate_hz,
            positions=positions,
            markers=("hand_top",),
            filled=np.zeros((len(positions), 1), dtype=bool),
            rate_hz=self.rate_hz,
            source=self.name,
        )

    def truth(self) -> LabelledSegments:
        """Return the two DMPs as segments with their labels."""
        labels = (f"to_subgoal{self.subgoal + 1}", f"from_subgoal{self.subgoal + 1}")
        bounds = np.array([[0, self.border], [self.border, len(self.positions)]])
        return LabelledSegments(bounds, labels, np.zeros(2), self.rate_hz, self.name)


def generate_sequenced_dmps(
    noise_m: float = 0.0, rate_hz: float = 100.0, seed: int = 0
) -> list[SequencedDmps]:
    """Generate three demonstrations through each of three subgoals.

    A subgoal is passed at a velocity of its own, which a demonstration varies, as it varies the
    shape and the duration.

    Parameters
    ----------
    noise_m : float
        Standard deviation of the noise of every coordinate, metres.
    rate_hz : float
        Samples per second, 20 to 500.
    seed : int
        Another seed, other demonstrations.

    Returns
    -------
    list of SequencedDmps
        Nine movements from (0, 0) to (1, 1).

    Raises
    ------
    ConfigError
        If a number is out of range.
    """
    for name, value, low, high in (
        ("noise_m", noise_m, 0.0, 1.0),
        ("rate_hz", rate_hz, 20.0, 500.0),
        ("seed", seed, 0, 2**63),
    ):
        if not low <= value <= high:
            raise ConfigError(f"sequenced_dmps: {name}: got {value}, expected {low} to {high}")
    movements = []
    for subgoal in range(len(SUBGOALS_M)):
        for number in range(N_DEMONSTRATIONS):
            stream = np.random.SeedSequence(seed, spawn_key=(subgoal, number))
            rng = np.random.default_rng(stream)
            positions, border = _draw_sequence(np.array(SUBGOALS_M[subgoal]), rate_hz, rng)
            positions = positions + noise_m * rng.standard_normal(positions.shape)
            name = f"subgoal{subgoal + 1}_demonstration{number + 1}"
            movements.append(SequencedDmps(positions, border, rate_hz, subgoal, name))
    return movements


def _draw_sequence(
    subgoal: FloatArray, rate_hz: float, rng: np.random.Generator
) -> tuple[FloatArray, int]:
    """Draw one demonstration; return its positions and the first sample of the second DMP."""
    goal = np.array(GOAL_M)
    durations = rng.uniform(0.9, 1.2, 2)
    counts = np.round(durations * rate_hz).astype(int)
    # Slow enough that the speed falls at the subgoal, fast enough that it does not rest there.
    mean_speed = np.linalg.norm(subgoal) / durations[0]
    velocity = rng.uniform(0.1, 0.4) * mean_speed * goal / np.linalg.norm(goal)
    still = np.zeros(2)
    weights = _WEIGHT_SCALE * rng.standard_normal((2, 2, _N_WEIGHTS))
    first, at = follow_moving_goal(
        (still, still), (subgoal, velocity), weights[0], counts[0], rate_hz
    )
    second, _ = follow_moving_goal(at, (goal, still), weights[1], counts[1], rate_hz)
    return np.concatenate([first, second]), int(counts[0])


def follow_moving_goal(
    start: tuple[FloatArray, FloatArray],
    goal: tuple[FloatArray, FloatArray],
    weights: FloatArray,
    n_samples: int,
    rate_hz: float,
) -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
    r"""Integrate a DMP that arrives with a velocity.

    The goal moves along the polynomial g(t) of fifth order from the start to the end conditions:

    .. math::

        \tau \dot v = \alpha (\beta (g - y) + \tau \dot g - v) + \tau^2 \ddot g + \eta f(s),
        \quad \tau \dot y = v, \quad \tau \dot s = -\alpha_s s

    Parameters
    ----------
    start, goal : tuple of array, shape (d,)
        Position (m) and velocity (m/s) at both ends; accelerations are zero.
    weights : array, shape (d, K)
        Weights of the forcing term f.
    n_samples : int
        Duration times rate.
    rate_hz : float
        Samples per second.

    Returns
    -------
    positions : array, shape (n_samples, d)
        From the start to one sample before the end, metres.
    end : tuple of array, shape (d,)
        Position and velocity in the end.

    References
    ----------
    K. Mülling, J. Kober, O. Kroemer, J. Peters: Learning to select and generalize striking
    movements in robot table tennis. International Journal of Robotics Research 32(3), 2013,
    doi:10.1177/0278364912472380
    """
    tau = n_samples / rate_hz
    step = 1.0 / (rate_hz * _SUBSTEPS)
    # What drives the system does not depend on its state: it is known at all half steps.
    t: FloatArray = 0.5 * step * np.arange(2.0 * n_samples * _SUBSTEPS + 1.0)
    coefficients = _quintic(start, goal, tau)
    g, dg, ddg = (
        np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyder(coefficients, order))
        for order in range(3)
    )
    amplitude = goal[0] - start[0]
    force: FloatArray = amplitude * (_forcing(t / tau, weights.shape[1]) @ weights.T)
    drive = np.asarray(_ALPHA * (_BETA * g + tau * dg) + tau**2 * ddg).T + force

    y, v = start[0], tau * start[1]
    positions = np.empty((n_samples, len(amplitude)))
    for k in range(n_samples * _SUBSTEPS):
        if k % _SUBSTEPS == 0:
            positions[k // _SUBSTEPS] = y
        # The midpoint rule: the movement is smooth over a step of a few milliseconds.
        half = 0.5 * step / tau
        middle_y = y + half * v
        middle_v = v + half * (drive[2 * k] - _ALPHA * (_BETA * y + v))
        y = y + 2.0 * half * middle_v
        v = v + 2.0 * half * (drive[2 * k + 1] - _ALPHA * (_BETA * middle_y + middle_v))
    return positions, (y, v / tau)


def _quintic(
    start: tuple[FloatArray, FloatArray], goal: tuple[FloatArray, FloatArray], tau: float
) -> FloatArray:
    """Coefficients of the polynomial between positions and velocities, shape (6, d)."""
    ends = np.stack([start[0], start[1], 0 * start[0], goal[0], goal[1], 0 * goal[0]])
    rows = []
    for t in (0.0, tau):
        for order in range(3):
            row = [np.polynomial.polynomial.polyder(unit, order) for unit in np.eye(6)]
            rows.append([np.polynomial.polynomial.polyval(t, c) for c in row])
    return np.linalg.solve(np.array(rows), ends)


def _forcing(x: FloatArray, n_weights: int) -> FloatArray:
    """Phase-scaled, normalised Gaussians at normalised time x (T,), shape (T, K)."""
    phase = np.power(_LAST_PHASE, x)
    centres = _LAST_PHASE ** np.linspace(0.0, 1.0, n_weights)
    gaps = np.diff(centres, append=0.9 * centres[-1])
    exponent = -0.5 * ((phase[:, np.newaxis] - centres) / gaps) ** 2
    # The nearest Gaussian is scaled to 1, so that none of the sums underflows.
    activation = np.exp(exponent - exponent.max(axis=1, keepdims=True))
    shares: FloatArray = activation / activation.sum(axis=1, keepdims=True)
    return phase[:, np.newaxis] * shares
