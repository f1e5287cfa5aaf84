"""The beta-process autoregressive hidden Markov model (BP-AR-HMM).

Recordings share a library of autoregressions of order 1. A beta process says which of them a
recording uses, a sticky transition matrix of its own how it switches between them. All unknowns
are drawn in turn (Markov chain Monte Carlo); what is returned is the most probable state drawn.

It is the model and the sampler of the paper, without the split and merge moves that were added
later: it mixes slowly, and another seed may give other borders.

References
----------
.. [1] E. B. Fox, E. B. Sudderth, M. I. Jordan, A. S. Willsky: Sharing features among dynamical
   systems with beta processes. NIPS 2009.
.. [2] M. C. Hughes, E. B. Fox, E. B. Sudderth: Effective split-merge Monte Carlo methods for
   nonparametric models of sequential data. NIPS 2012, section 3 (data-driven birth).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

from besman.exceptions import SegmentationError
from besman.stages.segment.bp_ar_hmm_prior import BpArHmmPrior, base_distribution, check_series
from besman.stages.segment.hmm_kernel import draw_states, filter_states
from besman.stages.segment.mniw import Mniw, log_likelihoods

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class BpArHmmResult(NamedTuple):
    """The most probable state drawn.

    Attributes
    ----------
    states : tuple of int array, shape (T,)
        Autoregression of every sample, one array for each recording; the same number is the same
        autoregression in all of them.
    log_probability : float
        Log-probability of the states, their sharing and the data, parameters integrated out,
        given the hyper-parameters of the same draw.
    """

    states: tuple[IntArray, ...]
    log_probability: float


def infer_shared_states(
    series: Sequence[npt.ArrayLike],
    n_sweeps: int,
    seed: int,
    prior: BpArHmmPrior | None = None,
    progress: Callable[[float], None] = lambda done: None,
) -> BpArHmmResult:
    """Draw `n_sweeps` times and return the most probable draw.

    Parameters
    ----------
    series : sequence of array, shape (T_i, d)
        Positions of every recording, zero mean.
    n_sweeps : int
        Draws of all unknowns.
    seed : int
        Of the random numbers.
    prior : BpArHmmPrior, optional
        Priors.
    progress : callable
        Called with the share done.

    Returns
    -------
    BpArHmmResult

    Raises
    ------
    SegmentationError
        If a recording has fewer than two samples, values are not finite, nothing moves, or a
        parameter is out of its range.
    """
    if n_sweeps < 1:
        raise SegmentationError(f"bp_ar_hmm: sweeps: got {n_sweeps}; expected at least 1")
    sampler = BpArHmmSampler(series, seed, prior or BpArHmmPrior())
    best = BpArHmmResult((), -np.inf)
    for sweep in range(n_sweeps):
        sampler.sweep()
        value = sampler.log_joint()
        if value > best.log_probability:
            # The first sample is given; it belongs to the segment of the second.
            states = tuple(np.concatenate([z[:1], z]) for z in sampler.states)
            best = BpArHmmResult(states, value)
        progress((sweep + 1) / n_sweeps)
    return best


class BpArHmmSampler:
    """The Markov chain.

    Attributes
    ----------
    used : bool array, shape (N, K)
        Which recording uses which autoregression; every column has a user.
    parameters : list of (A, Sigma), length K
        Arrays of shape (d, d).
    weights : list of array, shape (K, K)
        Transition weights eta of every recording; only those between used states matter.
    states : list of int array, shape (T_i - 1,)
        From the second sample on.
    mass, concentration, transition, stickiness : float
        Hyper-parameters.
    """

    def __init__(
        self, series: Sequence[npt.ArrayLike], seed: int, prior: BpArHmmPrior | None = None
    ) -> None:
        self.prior = prior or BpArHmmPrior()
        self._rng = np.random.default_rng(seed)
        arrays = check_series(series)
        d = arrays[0].shape[1]
        self.base = base_distribution(arrays, self.prior)
        self._y = [y[1:] for y in arrays]
        self._h = [y[:-1] for y in arrays]
        self.mass, self.concentration = self.prior.mass, self.prior.concentration
        self.transition, self.stickiness = self.prior.transition, self.prior.stickiness
        n = len(arrays)
        # One autoregression for all is where births can only help.
        self.used = np.ones((n, 1), dtype=bool)
        first = self.base.update(np.concatenate(self._h), np.concatenate(self._y))
        self.parameters = [first.draw(self._rng)]
        self.weights = [self._draw_weights(1) for _ in range(n)]
        self.states = [np.zeros(len(y), dtype=np.int64) for y in self._y]
        self._likelihoods = [np.empty((len(y), 0)) for y in self._y]
        self.dimensions = d
        self._evaluate()

    def sweep(self) -> None:
        """Draw all unknowns once."""
        for i in range(len(self._y)):
            value = self._filter(i, self.used[i])
            value = self._flip_shared(i, value)
            self._change_unique(i, value)
        self._drop_unused()
        self._draw_states()
        self._draw_transitions()
        self._draw_parameters()
        self._draw_hyper_parameters()

    def log_joint(self) -> float:
        """Log-probability of states, sharing and data, given the hyper-parameters."""
        value = self._log_sharing(self.concentration)
        for k in range(self.used.shape[1]):
            h, y = self._gather(k)
            value += self.base.log_evidence(h, y)
        for i, z in enumerate(self.states):
            active = np.flatnonzero(self.used[i])
            prior = self.transition + self.stickiness * np.eye(len(active))
            counts = self._count(z)[np.ix_(active, active)]
            value -= np.log(len(active))
            value += (gammaln(prior + counts) - gammaln(prior)).sum()
            totals = prior.sum(axis=1)
            value -= (gammaln(totals + counts.sum(axis=1)) - gammaln(totals)).sum()
        return float(value)

    def _flip_shared(self, i: int, value: float) -> float:
        """Take up or leave each autoregression that others use; returns the log-likelihood."""
        n, rng = len(self._y), self._rng
        others = self.used.sum(axis=0) - self.used[i]
        for k in map(int, np.flatnonzero(others)):
            odds = np.log(others[k]) - np.log(n - 1 + self.concentration - others[k])
            proposed = self.used[i].copy()
            proposed[k] = not proposed[k]
            before = self.weights[i].copy()
            if proposed[k]:
                self._draw_weights_of(i, k)
            new = self._filter(i, proposed)
            ratio = new - value + (odds if proposed[k] else -odds)
            if np.log(rng.random()) < ratio:
                self.used[i], value = proposed, new
            else:
                self.weights[i] = before
        return value

    def _change_unique(self, i: int, value: float) -> None:
        """Propose a new autoregression for one recording alone, or to give one up.

        A new one is drawn half of the time from the prior and half from the posterior of a window
        of the recording; the window is drawn in the same way for both directions.
        """
        n, rng = len(self._y), self._rng
        rate = self.mass * self.concentration / (n - 1 + self.concentration)
        unique = np.flatnonzero(self.used[i] & (self.used.sum(axis=0) == 1))
        drawn_length = int(rng.integers(self.prior.shortest, self.prior.longest + 1))
        length = min(drawn_length, len(self._y[i]))
        start = int(rng.integers(len(self._y[i]) - length + 1))
        window = slice(start, start + length)
        data = self.base.update(self._h[i][window], self._y[i][window])
        if rng.random() < 0.5:
            drawn = (data if rng.random() < 0.5 else self.base).draw(rng)
            self._append(i, drawn)
            new = self._filter(i, self.used[i])
            ratio = new - value + np.log(rate / (len(unique) + 1)) - self._excess(drawn, data)
            if np.log(rng.random()) >= ratio:
                self._keep(np.arange(self.used.shape[1] - 1))
        elif len(unique):
            k = int(rng.choice(unique))
            proposed = self.used[i].copy()
            proposed[k] = False
            new = self._filter(i, proposed)
            excess = self._excess(self.parameters[k], data)
            if np.log(rng.random()) < new - value + np.log(len(unique) / rate) + excess:
                self.used[i] = proposed

    def _excess(self, drawn: tuple[FloatArray, FloatArray], data: Mniw) -> float:
        """Log-ratio of the density of the proposal to that of the prior."""
        ratio = data.log_density(*drawn) - self.base.log_density(*drawn)
        return float(np.logaddexp(0.0, ratio) - np.log(2.0))

    def _draw_states(self) -> None:
        for i in range(len(self._y)):
            active = np.flatnonzero(self.used[i])
            filtered = np.empty((len(self._y[i]), len(active)))
            filter_states(self._likelihoods[i], self.weights[i], active, filtered)
            uniform = self._rng.random(len(filtered))
            self.states[i] = draw_states(self.weights[i], active, filtered, uniform)

    def _draw_transitions(self) -> None:
        """Draw the weights given the states: Dirichlet rows, each with a free total."""
        n_states = self.used.shape[1]
        for i, z in enumerate(self.states):
            weights = self._draw_weights(n_states)
            active = np.flatnonzero(self.used[i])
            prior = self.transition + self.stickiness * np.eye(len(active))
            rows = (
                self._rng.standard_gamma(prior + self._count(z)[np.ix_(active, active)])
                + np.finfo(float).tiny
            )
            totals = self._rng.standard_gamma(prior.sum(axis=1))
            rows *= (totals / rows.sum(axis=1))[:, np.newaxis]
            weights[np.ix_(active, active)] = np.maximum(rows, np.finfo(float).tiny)
            self.weights[i] = weights

    def _draw_parameters(self) -> None:
        for k in range(self.used.shape[1]):
            self.parameters[k] = self.base.update(*self._gather(k)).draw(self._rng)
        self._evaluate()

    def _draw_hyper_parameters(self) -> None:
        """Draw gamma from its posterior; c, alpha and kappa by Metropolis steps of their logs."""
        n, n_states = self.used.shape
        share = (self.concentration / (self.concentration + np.arange(n))).sum()
        self.mass = self._rng.gamma(1.0 + n_states, 1.0 / (1.0 / self.prior.mass + share))
        self.concentration = self._step(
            self.concentration, self.prior.concentration, self._log_sharing
        )
        blocks = [
            np.log(w[np.ix_(used, used)]) for w, used in zip(self.weights, self.used, strict=True)
        ]
        stay = np.concatenate([np.diag(block) for block in blocks])
        leave = np.concatenate([block[~np.eye(len(block), dtype=bool)] for block in blocks])

        def log_weights(transition: float, stickiness: float) -> float:
            both = transition + stickiness
            value = (transition - 1.0) * leave.sum() - len(leave) * gammaln(transition)
            return float(value + (both - 1.0) * stay.sum() - len(stay) * gammaln(both))

        self.transition = self._step(
            self.transition, self.prior.transition, lambda x: log_weights(x, self.stickiness)
        )
        self.stickiness = self._step(
            self.stickiness, self.prior.stickiness, lambda x: log_weights(self.transition, x)
        )

    def _step(self, value: float, mean: float, log_density: Callable[[float], float]) -> float:
        """One Metropolis step of the logarithm under an exponential prior."""
        new = float(value * np.exp(0.5 * self._rng.standard_normal()))
        ratio = log_density(new) - log_density(value) - (new - value) / mean + np.log(new / value)
        return new if np.log(self._rng.random()) < ratio else value

    def _log_sharing(self, concentration: float) -> float:
        """Log-probability of who uses what under the beta process, numbers unordered."""
        n, n_states = self.used.shape
        users = self.used.sum(axis=0)
        value = n_states * np.log(self.mass * concentration)
        value -= self.mass * (concentration / (concentration + np.arange(n))).sum()
        value += (gammaln(users) + gammaln(n - users + concentration)).sum()
        value -= n_states * gammaln(n + concentration)
        patterns = np.unique(self.used, axis=1, return_counts=True)[1]
        return float(value - gammaln(patterns + 1.0).sum())

    def _draw_weights(self, n_states: int) -> FloatArray:
        """Draw transition weights from their prior."""
        shape = self.transition + self.stickiness * np.eye(n_states)
        return np.maximum(self._rng.standard_gamma(shape), np.finfo(float).tiny)

    def _draw_weights_of(self, i: int, k: int) -> None:
        """Draw the weights from and to one state anew."""
        fresh = self._draw_weights(self.used.shape[1])
        self.weights[i][k], self.weights[i][:, k] = fresh[k], fresh[:, k]

    def _filter(self, i: int, used: npt.NDArray[np.bool_]) -> float:
        active = np.flatnonzero(used)
        filtered = np.empty((len(self._y[i]), len(active)))
        return float(filter_states(self._likelihoods[i], self.weights[i], active, filtered))

    def _evaluate(self) -> None:
        self._likelihoods = [
            np.stack([log_likelihoods(y, h, *pair) for pair in self.parameters], axis=1)
            for y, h in zip(self._y, self._h, strict=True)
        ]

    def _append(self, i: int, drawn: tuple[FloatArray, FloatArray]) -> None:
        """Add an autoregression that recording i uses alone."""
        n, n_states = self.used.shape
        column = np.arange(n)[:, np.newaxis] == i
        self.used = np.concatenate([self.used, column], axis=1)
        self.parameters.append(drawn)
        for j in range(n):
            weights = self._draw_weights(n_states + 1)
            weights[:n_states, :n_states] = self.weights[j]
            self.weights[j] = weights
            new = log_likelihoods(self._y[j], self._h[j], *drawn)[:, np.newaxis]
            self._likelihoods[j] = np.concatenate([self._likelihoods[j], new], axis=1)

    def _drop_unused(self) -> None:
        self._keep(np.flatnonzero(self.used.any(axis=0)))

    def _keep(self, kept: IntArray) -> None:
        """Forget all autoregressions but some."""
        self.used = self.used[:, kept]
        self.parameters = [self.parameters[k] for k in kept]
        self.weights = [weights[np.ix_(kept, kept)] for weights in self.weights]
        self._likelihoods = [values[:, kept] for values in self._likelihoods]

    def _gather(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Gather the samples in state k, and the ones before them."""
        chosen = [z == k for z in self.states]
        h = [h[rows] for h, rows in zip(self._h, chosen, strict=True)]
        y = [y[rows] for y, rows in zip(self._y, chosen, strict=True)]
        return np.concatenate(h), np.concatenate(y)

    def _count(self, z: IntArray) -> FloatArray:
        """Transitions between states, shape (K, K)."""
        counts = np.zeros((self.used.shape[1],) * 2)
        np.add.at(counts, (z[:-1], z[1:]), 1.0)
        return counts
