"""What every search keeps to; a new one needs its entry in `besman.search.kinds`, no more.

One for points needs the class with its keys too, in ``stages/refine/methods.py``.
"""

import inspect
from typing import get_args

import numpy as np
import pytest
from places import TOP
from typer.testing import CliRunner

from besman.cli.main import app
from besman.evaluation import refinement_problems
from besman.evaluation.refinement_functions import (
    FUNCTIONS,
    ContextualProblem,
    FunctionProblem,
    sphere,
)
from besman.exceptions import ConfigError
from besman.search.kinds import (
    CONTEXTUAL_NAMES,
    CONTEXTUAL_SEARCHES,
    SEARCH_NAMES,
    SEARCHES,
    search_kind,
    usual_spelling,
)
from besman.simulation.tasks.kinds import load_task
from besman.stages.refine import methods
from besman.stages.refine.methods import CONFIGS
from besman.stages.refine.stage import RefinementConfig
from besman.templates.files import load_template, parse_settings
from besman.templates.learning import TemplateConfig, Tries, learn_policy
from besman.work.work import Work

EVERY = pytest.mark.parametrize("name", SEARCH_NAMES)
CONTEXTUAL = pytest.mark.parametrize("name", CONTEXTUAL_NAMES)
WIDE = {"COLUMNS": "1000"}
D = 3
REGION = np.array([[1.0], [2.0]])


def search_of(name, seed=0, **more):
    config = CONFIGS[name].model_validate({"method": name, **more})
    return config.make_search(D, (seed,))


def learn(search, function, most, enough=np.inf):
    """Search until the budget ends or all is good; return all points and returns."""
    points, returns = np.empty((0, D)), np.empty(0)
    while len(returns) < most and not search.exhausted:
        if len(returns) >= 20 and np.median(returns[-20:]) > enough:
            break
        asked = search.ask()
        found = function(asked)
        search.tell(asked, found)
        points, returns = np.concatenate([points, asked]), np.concatenate([returns, found])
    return points, returns


def far_sphere(points):
    return sphere(points - 1.0)


@pytest.mark.parametrize("entry", SEARCHES, ids=lambda entry: entry.name)
def test_the_entry_names_a_search_and_its_keys(entry):
    config = CONFIGS[entry.name]
    assert get_args(config.model_fields["method"].annotation) == (entry.name,)
    own = config.model_fields.keys() - RefinementConfig.model_fields.keys()
    assert config.not_of_search <= own
    assert own - config.not_of_search <= inspect.signature(entry.load()).parameters.keys()
    assert entry.about
    assert entry.load().__doc__


@pytest.mark.parametrize("entry", CONTEXTUAL_SEARCHES, ids=lambda entry: entry.name)
def test_the_entry_names_a_contextual_search(entry):
    search = entry.load()
    assert {"features", "ridge", "seed", "region"} <= inspect.signature(search).parameters.keys()
    assert search.usual_sigma > 0
    assert search.usual_ridge > 0
    assert search.usual_generation(6, 2) > 6
    assert entry.about
    assert not entry.config


def test_every_spelling_means_one_search():
    spellings = [
        spelling
        for entry in (*SEARCHES, *CONTEXTUAL_SEARCHES)
        for spelling in (entry.name, *entry.also)
    ]
    assert len(set(spellings)) == len(spellings)
    for spelling in spellings:
        assert usual_spelling(spelling) == search_kind(spelling).name
    assert usual_spelling("nes") == "nes"


@EVERY
def test_the_top_of_a_sphere_is_found(name):
    search = search_of(name)
    _, returns = learn(search, far_sphere, 3000, enough=-0.01)
    assert returns.max() > -0.01
    # And not by luck: most of what it tries at the end is as near.
    assert np.median(returns[-20:]) > -0.01


@EVERY
def test_the_same_seed_asks_for_the_same_points(name):
    one, two, other = (search_of(name, seed) for seed in (1, 1, 2))
    points, _ = learn(one, far_sphere, 100)
    np.random.default_rng(0).random(5)
    np.random.seed(3)  # noqa: NPY002
    again, _ = learn(two, far_sphere, 100)
    np.testing.assert_array_equal(points, again)
    assert not np.array_equal(points, learn(other, far_sphere, 100)[0])


@EVERY
def test_bounds_hold_and_no_number_pulls_a_search(name):
    def broken(points):
        returns = far_sphere(points)
        returns[::3] = np.nan
        returns[1] = -np.inf
        return returns

    search = search_of(name, bound=0.5, population=12)
    points, _ = learn(search, broken, 300)
    assert points.shape[1] == D
    assert np.isfinite(points).all()
    assert np.abs(points).max() <= 0.5
    search.tell(search.ask(), np.full(12, np.nan))
    assert np.isfinite(search.ask()).all()


@EVERY
def test_an_ended_search_goes_on_as_if_it_had_not_been(name, robot, make_plan, tmp_path):
    config = CONFIGS[name].model_validate({"method": name, "episodes": 21, "robustness": None})
    plans, task = (make_plan(0.54, target=np.array([5.0, 0, 0])),), load_task("stick_throw")
    (whole,) = config.run(plans, robot, task)
    (kept,) = config.run(plans, robot, task, Work(checkpoints=tmp_path))
    # What all motions share is a file.
    (own,) = (path for path in tmp_path.iterdir() if path.is_dir())
    generations = sorted(own.iterdir())
    before = [path.read_bytes() for path in generations[:2]]
    for path in generations[2:]:
        path.unlink()
    (resumed,) = config.run(plans, robot, task, Work(checkpoints=tmp_path))
    assert sorted(own.iterdir()) == generations
    assert [path.read_bytes() for path in generations[:2]] == before
    for one in (kept, resumed):
        np.testing.assert_array_equal(one.returns, whole.returns)
        np.testing.assert_array_equal(one.positions, whole.positions)


@pytest.fixture
def small(monkeypatch):
    """Make the functions that searches are compared on small."""
    monkeypatch.setitem(
        FUNCTIONS, "sphere", lambda: FunctionProblem("sphere", sphere, D, 1.0, 1.0, -1e-3, 150)
    )
    monkeypatch.setitem(
        FUNCTIONS,
        "contextual_sphere",
        lambda: ContextualProblem("contextual_sphere", sphere, D, 1, -1e-3, 300),
    )
    return refinement_problems


def evaluate(problem, method):
    options = ["--problem", problem, "--method", method, "--seeds", "1", "--jobs", "1"]
    done = CliRunner().invoke(app, ["evaluate", "refinement", *options], env=WIDE)
    assert done.exit_code == 0, done.output
    return done.output


@EVERY
def test_it_is_compared_by_its_name(name, small):
    assert name in evaluate("sphere", name)


@pytest.mark.parametrize("entry", CONTEXTUAL_SEARCHES, ids=lambda entry: entry.name)
def test_a_contextual_one_is_compared_by_any_of_its_names(entry, small):
    for spelling in (entry.name, *entry.also):
        assert f"{entry.name} " in evaluate("contextual_sphere", spelling)


def shifted(points, contexts):
    """Give the best return where every coordinate is the context."""
    return -np.sum((points - contexts) ** 2, axis=1)


def try_shifted(points, contexts):
    returns = shifted(points, contexts)
    return Tries(contexts, points, returns, np.sqrt(-returns), returns > -0.01)


def template_of(name, **more):
    return TemplateConfig(method=name, episodes=600, checks=20, features="affine", **more)


@CONTEXTUAL
def test_the_best_point_of_every_context_is_learnt(name):
    policy, tries, checks = learn_policy(template_of(name), D, REGION, try_shifted)
    assert checks.rewards.min() > -0.02
    assert tries.rewards[-20:].mean() > tries.rewards[:20].mean()
    np.testing.assert_allclose(policy.means([[1.2], [1.9]]), [[1.2] * D, [1.9] * D], atol=0.1)


@CONTEXTUAL
def test_the_same_seed_learns_the_same_policy_and_goes_on_where_it_was(name):
    kept = []
    config = template_of(name, sigma=0.5)
    whole, tries, _ = learn_policy(config, D, REGION, try_shifted, keep=kept.append)
    tried = []

    def count(points, contexts):
        tried.append(len(points))
        return try_shifted(points, contexts)

    half = kept[len(kept) // 2]
    again, retried, _ = learn_policy(config, D, REGION, count, known=half)
    np.testing.assert_array_equal(again.gain, whole.gain)
    np.testing.assert_array_equal(retried.points, tries.points)
    assert sum(tried) == len(tries.rewards) - len(half.rewards) + config.checks
    other, _, _ = learn_policy(template_of(name, sigma=0.5, seed=1), D, REGION, try_shifted)
    assert not np.array_equal(other.gain, whole.gain)


@pytest.mark.parametrize("entry", CONTEXTUAL_SEARCHES, ids=lambda entry: entry.name)
def test_templates_take_any_spelling(entry):
    for spelling in (entry.name, *entry.also):
        assert parse_settings({"method": spelling}).method == entry.name
        assert parse_settings({}, (f"method={spelling}",)).method == entry.name
    with pytest.raises(ConfigError) as caught:
        parse_settings({"method": "nes"})
    assert entry.name in str(caught.value)


@pytest.mark.parametrize("entry", CONTEXTUAL_SEARCHES, ids=lambda entry: entry.name)
def test_templates_of_an_older_name_are_found(entry, tmp_path):
    from besman.records.files import save_record

    folder = tmp_path / "templates"
    folder.mkdir()

    def store(name):
        save_record((name,), folder / f"{name}.npz")
        (folder / f"{name}.json").write_text("{}")

    for older in entry.also:
        store(older)
        for spelling in (None, entry.name, older):
            assert load_template(tmp_path, spelling) == (older,)
    store(entry.name)
    for spelling in (None, entry.name, *entry.also):
        assert load_template(tmp_path, spelling) == (entry.name,)


def test_messages_help_and_page_go_through_the_table():
    done = CliRunner().invoke(app, ["evaluate", "refinement", "--help"], env=WIDE)
    for name in (*SEARCH_NAMES, *CONTEXTUAL_NAMES):
        assert name in done.output
    done = CliRunner().invoke(app, ["template", "learn", "--help"], env=WIDE)
    for name in CONTEXTUAL_NAMES:
        assert name in done.output
    page = (TOP / "docs/reference/pipeline.md").read_text()
    for table in ("SEARCHES", "CONTEXTUAL_SEARCHES"):
        assert f"{{table-of}} besman.search.kinds:{table}\n" in page


def test_every_search_of_the_folder_is_entered():
    """A class that can be asked and told, and that nobody entered, is found."""
    from importlib import import_module

    found = set()
    for path in (TOP / "besman/search").glob("*.py"):
        module = import_module(f"besman.search.{path.stem}") if path.stem != "__init__" else None
        for thing in vars(module).values() if module else ():
            own = inspect.isclass(thing) and thing.__module__ == module.__name__
            if own and not inspect.isabstract(thing) and not getattr(thing, "_is_protocol", False):
                found |= {thing} if hasattr(thing, "ask") and hasattr(thing, "tell") else set()
    # Searches of a placement's box are chosen by `map: {optimizer: ...}`; a relay is several.
    elsewhere = {"besman.search.in_a_box", "besman.search.relay"}
    others = {one for one in found if one.__module__ in elsewhere}
    entered = {entry.load() for entry in (*SEARCHES, *CONTEXTUAL_SEARCHES)}
    assert found - others == entered
    keys = {one for one in vars(methods).values() if inspect.isclass(one)}
    keys = {one for one in keys if issubclass(one, RefinementConfig)} - {RefinementConfig}
    assert keys == set(CONFIGS.values())
