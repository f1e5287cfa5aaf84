import pytest

from besman.config.resources import find_resource
from besman.config.settings import (
    absolute,
    apply_settings,
    own_file,
    parse_setting,
    resolve_paths,
)
from besman.exceptions import ConfigError
from besman.pipeline.config import PATHS, PipelineConfig, load_pipeline
from besman.stages.label.stage import LabelConfig

STICK_THROW = find_resource("pipelines", "ur5_stick_throw")


def test_values_are_yaml():
    assert parse_setting("select.label=throw", "") == ("select.label", "throw")
    assert parse_setting("a=[1, 2.5]", "") == ("a", [1, 2.5])
    assert parse_setting("a=", "") == ("a", None)
    with pytest.raises(ConfigError, match=r"--set: got '=1', expected KEY=VALUE, e\.g\. a=2"):
        parse_setting("=1", "a=2")


def test_another_method_leaves_out_options_of_the_old_one():
    named = load_pipeline(STICK_THROW, ("label.method=named",)).label
    assert named == LabelConfig(markers="right_arm")
    written = {"method": "trajectories", "learn_from": "a.tsv", "longest_gap_s": 0.1}
    content = {"label": written}
    apply_settings(content, ("label.method=named",), PipelineConfig, PATHS)
    assert content == {"label": {"method": "named", "longest_gap_s": 0.1}}


def test_what_is_asked_for_beside_the_method_is_not_left_out():
    settings = ("label.learn_from=a.tsv", "label.method=named")
    with pytest.raises(ConfigError, match=r"label.*learn_from"):
        load_pipeline(STICK_THROW, settings)


@pytest.mark.parametrize("setting", ["label.method=nmaed", "label.method=[1]", "name.method=x"])
def test_a_method_that_is_none_leaves_out_nothing(setting):
    with pytest.raises(ConfigError):
        load_pipeline(STICK_THROW, (setting,))


def test_sections_that_are_not_there_are_made():
    content = {}
    apply_settings(content, ("segment.method=vmci", "margin_s=0.2"), PipelineConfig, PATHS)
    assert content == {"segment": {"method": "vmci"}, "margin_s": 0.2}


def test_paths_are_of_a_folder(tmp_path):
    assert absolute(["a", "b/c"], tmp_path) == [str(tmp_path / "a"), str(tmp_path / "b" / "c")]
    assert absolute(3, tmp_path) == 3
    assert own_file("ur5", tmp_path) == "ur5"
    assert own_file("arm.yaml", tmp_path) == str(tmp_path / "arm.yaml")


def set_key(content, key, value):
    *parents, last = key.split(".")
    for parent in parents:
        content = content.setdefault(parent, {})
    content[last] = value


def get_key(content, key):
    for part in key.split("."):
        content = content[part]
    return content


@pytest.mark.parametrize("key", PATHS)
@pytest.mark.parametrize("whole_section", [False, True])
def test_every_path_is_of_the_file_or_of_the_working_directory(
    tmp_path, monkeypatch, key, whole_section
):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    content = {}
    set_key(content, key, "of_file.yaml")
    resolve_paths(content, tmp_path, PATHS)
    assert get_key(content, key) == str(tmp_path / "of_file.yaml")
    setting = f"{key}=own.yaml"
    if whole_section and "." in key:
        section, last = key.split(".")
        setting = f"{section}={{{last}: own.yaml}}"
    apply_settings(content, (setting,), PipelineConfig, PATHS)
    assert get_key(content, key) == str(tmp_path / "here" / "own.yaml")


def test_what_is_no_section_has_no_paths(tmp_path):
    content = {"label": "x", "recordings": 3}
    resolve_paths(content, tmp_path, PATHS)
    assert content == {"label": "x", "recordings": 3}


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            "select.lable=x",
            r"--set select\.lable: unknown key 'select\.lable'; did you mean 'label'",
        ),
        (
            "refine.robust.nix=2",
            r"--set refine\.robust\.nix: unknown key .* allowed: models, seed, spreads$",
        ),
        ("refine.robust.models=x", r"--set refine\.robust\.models: got 'x'; input should be a"),
        (
            "refine={method: reps, nix: 1}",
            r"--set refine: unknown key 'refine\.nix'; .*epsilon",
        ),
        ("recordings=[1]", r"--set recordings: recordings\.0: got 1; input"),
        ("refine.method=nix", r"--set refine\.method: got 'nix'; allowed: cem, cma_es, gauss_n"),
        ("select.a[b=1", r"--set select\.a\[b: unknown key 'select\.a\[b'; .*allowed: action"),
        ("robot=3", r"--set robot: got 3; input should be a valid string"),
    ],
)
def test_errors_in_settings_name_the_setting(setting, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load_pipeline(STICK_THROW, (setting,))
    allowed = str(caught.value).partition("allowed: ")[2].split(", ")
    assert len(set(allowed)) == len(allowed)
