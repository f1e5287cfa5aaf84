"""A recurrent network with one layer of long short-term memory."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from besman.classifiers.sequences import ProbabilisticClassifier, import_extra

FloatArray = npt.NDArray[np.float64]

# A class gives one of this many examples to the validation; with fewer none can be spared.
_ONE_IN = 5


class LstmClassifier(ProbabilisticClassifier):
    """One LSTM layer, a dense layer and softmax; trained on the CPU with early stopping.

    Parameters
    ----------
    n_channels : int
        Channels of a point.
    n_cells : int
        Cells of the layer.
    batch_size : int
        Sequences of a step.
    patience : int
        Epochs without a better validation after which training ends and the best state is kept.
        One in five examples of each class is for validation; of fewer than five none can be spared,
        and the loss on the training set takes its place.
    max_epochs : int
        Most epochs.
    learning_rate : float
        Of Adam.
    random_state : int
        Seed of the first weights, the split and the order.

    References
    ----------
    Thesis 5.2.3.
    """

    def __init__(
        self,
        n_channels: int = 1,
        n_cells: int = 25,
        batch_size: int = 16,
        patience: int = 10,
        max_epochs: int = 150,
        learning_rate: float = 0.01,
        random_state: int = 0,
    ) -> None:
        self.n_channels = n_channels
        self.n_cells = n_cells
        self.batch_size = batch_size
        self.patience = patience
        self.max_epochs = max_epochs
        self.learning_rate = learning_rate
        self.random_state = random_state

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike) -> LstmClassifier:
        """Train.

        Parameters
        ----------
        X : array, shape (N, P * n_channels)
        y : array, shape (N,)
        """
        sequences, codes = self._check_training(X, y)
        torch = _torch()
        threads = torch.get_num_threads()
        # Sums in one order, whatever the machine; and small matrices gain nothing from threads.
        torch.set_num_threads(1)
        try:
            with torch.random.fork_rng(devices=[]):
                torch.manual_seed(self.random_state)
                self.parameters_ = self._train(torch, sequences, codes)
        finally:
            torch.set_num_threads(threads)
        return self

    def predict_proba(self, X: npt.ArrayLike) -> FloatArray:
        """Return the probability of each class, shape (S, K)."""
        sequences = self._check_test(X)
        torch = _torch()
        network = _network(torch, self.n_channels, self.n_cells, len(self.classes_))
        state = {name: torch.from_numpy(np.array(v)) for name, v in self.parameters_.items()}
        network.load_state_dict(state)
        with torch.no_grad():
            scores = _scores(network, torch.from_numpy(sequences).float())
            return np.asarray(torch.softmax(scores.double(), dim=1).numpy())

    def _train(self, torch: Any, sequences: FloatArray, codes: Any) -> dict[str, Any]:
        """Return the parameters of the best epoch."""
        rng = np.random.default_rng(self.random_state)
        held = _hold_out(codes, rng)
        inputs = torch.from_numpy(sequences).float()
        targets = torch.from_numpy(np.asarray(codes, dtype=np.int64))
        learn, check = np.flatnonzero(~held), np.flatnonzero(held if held.any() else ~held)
        network = _network(torch, self.n_channels, self.n_cells, len(self.classes_))
        optimiser = torch.optim.Adam(network.parameters(), lr=self.learning_rate)
        loss_of = torch.nn.CrossEntropyLoss()
        best, since, kept = np.inf, 0, {}
        for _ in range(self.max_epochs):
            for batch in np.array_split(rng.permutation(learn), -(-len(learn) // self.batch_size)):
                optimiser.zero_grad()
                loss_of(_scores(network, inputs[batch]), targets[batch]).backward()
                optimiser.step()
            with torch.no_grad():
                loss = float(loss_of(_scores(network, inputs[check]), targets[check]))
            if loss < best - 1e-4:
                best, since = loss, 0
                kept = {name: v.numpy().copy() for name, v in network.state_dict().items()}
            else:
                since += 1
            if since >= self.patience:
                break
        return kept or {name: v.numpy().copy() for name, v in network.state_dict().items()}


def _torch() -> Any:
    return import_extra("torch", "lstm", "besman[lstm]")


def _network(torch: Any, n_channels: int, n_cells: int, n_classes: int) -> Any:
    return torch.nn.ModuleDict(
        {
            "lstm": torch.nn.LSTM(n_channels, n_cells, batch_first=True),
            "dense": torch.nn.Linear(n_cells, n_classes),
        }
    )


def _scores(network: Any, inputs: Any) -> Any:
    """Return scores of the classes after the last point, shape (S, K)."""
    outputs, _ = network["lstm"](inputs)
    return network["dense"](outputs[:, -1])


def _hold_out(codes: Any, rng: np.random.Generator) -> npt.NDArray[np.bool_]:
    """Choose examples for validation; none at all unless every class can spare one."""
    held = np.zeros(len(codes), dtype=bool)
    counts = np.bincount(codes)
    if counts.min() >= _ONE_IN:
        for code, count in enumerate(counts):
            rows = rng.permutation(np.flatnonzero(codes == code))
            held[rows[: count // _ONE_IN]] = True
    return held
