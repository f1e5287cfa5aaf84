"""The estimators, under scikit-learn's own checks and against brute force."""

import importlib
from functools import partial

import numpy as np
import pytest
from places import TOP
from typer.testing import CliRunner

from besman.classifiers import hmm
from besman.classifiers.kinds import CLASSIFIER_NAMES, CLASSIFIERS
from besman.cli.main import app
from besman.exceptions import RecognitionError
from besman.stages.recognize.stage import CONFIGS


def estimators():
    from besman.classifiers.hmm import HmmClassifier
    from besman.classifiers.lstm import LstmClassifier
    from besman.classifiers.neighbours import DtwNeighbour, NearestNeighbours

    return {
        "sklearn": NearestNeighbours(),
        "numba": DtwNeighbour(n_channels=2),
        "hmmlearn": HmmClassifier(n_channels=2),
        "torch": LstmClassifier(n_channels=2, n_cells=8, max_epochs=60),
    }


LIBRARIES = ("sklearn", "numba", "hmmlearn", "torch")


def estimator(library):
    pytest.importorskip(library)
    return estimators()[library]


def waves(n=8, n_points=20, seed=0):
    """Sine, cosine and rest in two channels, with noise and a shift in time."""
    rng = np.random.default_rng(seed)
    rows, labels = [], []
    for label in ("cosine", "rest", "sine"):
        for _ in range(n):
            t = np.linspace(0, 2 * np.pi, n_points) + rng.normal(scale=0.15)
            wave = {"sine": np.sin(t), "cosine": np.cos(t), "rest": 0 * t}[label]
            rows.append(
                np.stack([wave, wave**2], axis=1) + rng.normal(scale=0.05, size=(n_points, 2))
            )
            labels.append(label)
    return np.array(rows).reshape(len(rows), -1), np.array(labels)


@pytest.mark.parametrize("library", LIBRARIES)
def test_waves_are_told_apart(library):
    learnt = estimator(library).fit(*waves())
    X, y = waves(seed=1)
    if library != "hmmlearn":  # One hidden state does not see the order of points.
        assert learnt.score(X, y) == 1.0
    else:
        assert learnt.score(X[y != "cosine"], y[y != "cosine"]) == 1.0
    assert learnt.uncertainty(X).shape == (len(X),)
    assert np.isfinite(learnt.uncertainty(X)).all()


@pytest.mark.parametrize("library", LIBRARIES)
def test_the_same_seed_gives_the_same_answers(library):
    X, y = waves(4)
    one, other = (estimator(library).fit(X, y).uncertainty(X) for _ in range(2))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("library", ["hmmlearn", "torch"])
def test_parameters_are_all_that_was_learnt(library):
    X, y = waves(6)
    learnt = estimator(library).fit(X, y)
    again = estimator(library).restore(("cosine", "rest", "sine"), learnt.parameters_, X.shape[1])
    np.testing.assert_array_equal(learnt.predict_proba(X), again.predict_proba(X))


@pytest.mark.parametrize("library", ["hmmlearn", "torch"])
def test_probabilities_sum_to_one_with_one_example_a_class(library):
    X, y = waves(1)
    np.testing.assert_allclose(estimator(library).fit(X, y).predict_proba(X).sum(axis=1), 1.0)


def test_more_states_than_points_leave_a_proper_model():
    pytest.importorskip("hmmlearn")
    from besman.classifiers.hmm import HmmClassifier

    X, y = waves(2, n_points=4)
    learnt = HmmClassifier(n_channels=2, n_states=10).fit(X, y)
    assert all(np.isfinite(values).all() for values in learnt.parameters_.values())
    assert np.isfinite(learnt.log_likelihood(X)).all()


def test_warped_distances_are_those_of_dynamic_programming():
    from besman.classifiers.neighbours import DtwNeighbour

    rng = np.random.default_rng(3)
    X = rng.normal(size=(4, 12))
    learnt = DtwNeighbour(n_channels=2, band_points=6).fit(X[:1], ["a"])
    for row in X[1:]:
        a, b = row.reshape(-1, 2), X[0].reshape(-1, 2)
        cost = np.full((7, 7), np.inf)
        cost[0, 0] = 0.0
        for i in range(6):
            for k in range(6):
                least = min(cost[i, k], cost[i, k + 1], cost[i + 1, k])
                cost[i + 1, k + 1] = least + np.sum((a[i] - b[k]) ** 2)
        found = learnt.uncertainty(row[np.newaxis])[0] * np.sqrt(12)
        np.testing.assert_allclose(found, np.sqrt(cost[-1, -1]))


def test_values_that_make_no_whole_points_are_refused():
    from besman.classifiers.neighbours import DtwNeighbour

    with pytest.raises(ValueError, match="got 5 values a sequence, expected a multiple of n_chann"):
        DtwNeighbour(n_channels=2).fit(np.zeros((2, 5)), ["a", "b"])


@pytest.mark.parametrize(
    ("library", "said"),
    [
        ("torch", "method lstm: torch is not installed; pip install 'besman[lstm]'"),
        ("hmmlearn", "method hmm: hmmlearn is not installed; pip install 'hmmlearn'"),
    ],
)
def test_a_library_that_is_not_there_is_named(library, said, monkeypatch):
    real = importlib.import_module

    def block(name, *args, **kwargs):
        if name.split(".")[0] == library:
            raise ModuleNotFoundError(name=name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr("importlib.import_module", block)
    X, y = waves(n=2)
    with pytest.raises(RecognitionError, match=said.replace("[", r"\[") + "$"):
        estimators()[library].fit(X, y).predict(X)


NOT_APPLICABLE = {
    "check_array_api_input": "classifiers work on NumPy arrays; needs SCIPY_ARRAY_API set",
    "check_classifiers_multilabel_output_format_decision_function": "neighbours only vote",
}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("library", LIBRARIES)
def test_scikit_learns_checks_pass(library, monkeypatch):
    from sklearn.utils.estimator_checks import check_estimator

    chosen = estimator(library)
    if "n_channels" in chosen.get_params():
        chosen.set_params(n_channels=1)
    if "n_states" in chosen.get_params():
        # One state does not see the order of points, by which the checks' classes differ.
        chosen.set_params(n_states=2)
        # Hundreds of fits, of which none is to be the best.
        monkeypatch.setattr(hmm, "_gaussian_hmm", partial(hmm._gaussian_hmm, n_iter=2))
    checks = check_estimator(chosen, on_skip=None)
    left_out = {check["check_name"] for check in checks if check["status"] != "passed"}
    assert left_out <= set(NOT_APPLICABLE)
    assert len(checks) - len(left_out) > 50


def test_the_table_and_the_help_name_every_classifier():
    assert tuple(CONFIGS) == CLASSIFIER_NAMES
    made = estimators()
    assert tuple(entry.library for entry in CLASSIFIERS) == tuple(made)
    for entry in CLASSIFIERS:
        assert isinstance(entry.make({}, 2), type(made[entry.library]))
        assert entry.learns_parameters == hasattr(made[entry.library], "restore")
        assert entry.about
    help_words = ["evaluate", "recognition", "--help"]
    told = CliRunner().invoke(app, help_words, env={"COLUMNS": "1000"}).output
    assert ", ".join(CLASSIFIER_NAMES) in told
    page = (TOP / "docs/reference/pipeline.md").read_text()
    assert "{table-of} besman.classifiers.kinds:CLASSIFIERS" in page
