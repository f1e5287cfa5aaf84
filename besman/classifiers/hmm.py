"""One hidden Markov model a class."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from besman.classifiers.sequences import ProbabilisticClassifier, import_extra

FloatArray = npt.NDArray[np.float64]

_PRIOR = 1.001
_PARTS = ("startprob", "transmat", "means", "covars")


class HmmClassifier(ProbabilisticClassifier):
    """Hidden Markov models with Gaussian emissions, one for each class.

    Parameters
    ----------
    n_channels : int
        Channels of a point.
    n_states : int
        Hidden states; fewer if the examples of a class have fewer points.
    smallest_variance : float
        Variances are at least this, so that few examples do not make a class infinitely narrow.
    random_state : int
        Seed of the first guess.

    References
    ----------
    Thesis 5.2.2.
    """

    def __init__(
        self,
        n_channels: int = 1,
        n_states: int = 1,
        smallest_variance: float = 1e-2,
        random_state: int = 0,
    ) -> None:
        self.n_channels = n_channels
        self.n_states = n_states
        self.smallest_variance = smallest_variance
        self.random_state = random_state

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike) -> HmmClassifier:
        """Learn one model for each class by Baum-Welch.

        Parameters
        ----------
        X : array, shape (N, P * n_channels)
        y : array, shape (N,)
        """
        import logging

        sequences, codes = self._check_training(X, y)
        # States that no point belongs to, and a likelihood that falls by rounding, are no news.
        logging.getLogger("hmmlearn").setLevel(logging.ERROR)
        self.parameters_: dict[str, Any] = {}
        for code in range(len(self.classes_)):
            own = sequences[codes == code]
            points = own.reshape(-1, self.n_channels)
            n_states = min(self.n_states, len(np.unique(points, axis=0)))
            hmm = _gaussian_hmm(
                n_states,
                covariance_type="diag",
                min_covar=self.smallest_variance,
                random_state=self.random_state,
                # Weak priors: a state that no point belongs to stays a proper one.
                startprob_prior=_PRIOR,
                transmat_prior=_PRIOR,
                means_prior=points.mean(axis=0),
                means_weight=_PRIOR - 1.0,
            ).fit(points, [own.shape[1]] * len(own))
            covars = np.diagonal(hmm.covars_, axis1=1, axis2=2)
            covars = np.maximum(covars, self.smallest_variance)
            values = (_proper(hmm.startprob_), _proper(hmm.transmat_), hmm.means_, covars)
            for part, value in zip(_PARTS, values, strict=True):
                self.parameters_[f"{part}_{code}"] = np.array(value)
        return self

    def log_likelihood(self, X: npt.ArrayLike) -> FloatArray:
        """Return the log-likelihood of each sequence under each class, shape (S, K)."""
        sequences = self._check_test(X)
        found = np.empty((len(sequences), len(self.classes_)))
        for code in range(len(self.classes_)):
            hmm = self._model(code)
            found[:, code] = [hmm.score(sequence) for sequence in sequences]
        return found

    def predict_proba(self, X: npt.ArrayLike) -> FloatArray:
        """Return the probability of each class if all are equally frequent, shape (S, K)."""
        logs = self.log_likelihood(X)
        weights = np.exp(logs - logs.max(axis=1, keepdims=True))
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))

    def _model(self, code: int) -> Any:
        start, moves, means, covars = (self.parameters_[f"{part}_{code}"] for part in _PARTS)
        hmm = _gaussian_hmm(len(start), covariance_type="diag")
        hmm.n_features = self.n_channels
        hmm.startprob_, hmm.transmat_, hmm.means_, hmm.covars_ = start, moves, means, covars
        return hmm


def _gaussian_hmm(n_states: int, **settings: Any) -> Any:
    # Itself, not the extra: that leaves it out where there is no wheel, and pip builds it.
    return import_extra("hmmlearn.hmm", "hmm", "hmmlearn").GaussianHMM(n_states, **settings)


def _proper(probabilities: FloatArray) -> FloatArray:
    """Make rows sum to one: of a state that is never left nothing was learnt."""
    total = probabilities.sum(axis=-1, keepdims=True)
    even = 1.0 / probabilities.shape[-1]
    return np.where(total > 0, probabilities / np.where(total > 0, total, 1.0), even)
