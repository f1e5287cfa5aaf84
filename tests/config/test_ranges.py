"""Every number of every config has a range, and the ranges let through what besman itself says."""

import importlib
import pkgutil
from typing import get_args

import pytest
from places import TOP
from pydantic import ValidationError

import besman
from besman.config.ranges import RANGES, SMALLEST, check_values, range_of
from besman.config.stage import Config
from besman.exceptions import BesmanError
from besman.foreign.names import LONGEST_TEXT
from besman.person.marker_set import load_marker_set
from besman.pipeline.config import load_pipeline
from besman.robot.config import JointConfig, ToolConfig
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import is_whole_task, load_task, load_whole_task
from besman.stages.label.stage import LabelConfig

EVERY = [
    module.name
    for module in pkgutil.walk_packages(besman.__path__, "besman.")
    if not module.name.endswith("__main__")
]


def all_configs(kind=Config):
    for one in kind.__subclasses__():
        if one.__module__.startswith("besman."):
            yield one
            yield from all_configs(one)


def has_numbers(annotation):
    return annotation in (int, float) or any(map(has_numbers, get_args(annotation)))


@pytest.fixture(scope="module")
def configs():
    for name in EVERY:
        importlib.import_module(name)
    return sorted(set(all_configs()), key=lambda one: (one.__module__, one.__name__))


def test_defaults_are_in_range(configs):
    seen = set()
    for config in configs:
        for key, field in config.model_fields.items():
            if has_numbers(field.annotation):
                seen.add(key)
                value = field.get_default(call_default_factory=True)
                if isinstance(value, int | float | tuple):
                    check_values(key, value)
    assert len(seen) > 150


@pytest.mark.parametrize("far", [1e300, -1e300, 10**400])
def test_nothing_takes_a_number_out_of_all_sense(configs, far):
    """Every field with a number alone refuses it, whatever else is missing beside it."""
    looked_at = 0
    for config in configs:
        for key, field in config.model_fields.items():
            if field.annotation not in (int, float):
                continue
            with pytest.raises(ValidationError) as error:
                config.model_validate({key: far})
            assert key in {detail["loc"][-1] for detail in error.value.errors()}, (config, key)
            looked_at += 1
    assert looked_at > 150


def test_every_key_has_the_range_of_its_unit():
    assert RANGES[-1].endings == ("",)
    for key, unit in {
        "seed": "", "miss_per_m": "", "orientation_weight_m_rad": "m/rad", "noise_rad": "rad",
        "velocity_deg_s": "degrees/s", "acceleration_rad_s2": "rad/s^2", "speed_m_s": "m/s",
        "jerk_rad_s3": "rad/s^3",
        "home_deg": "degrees", "cutoff_hz": "Hz", "inertia_kgm2": "kg m^2", "mass_kg": "kg",
        "damping_nms": "N m s", "torque_nm": "N m", "force_n": "N", "radius_m": "m",
        "length_m": "m", "longest_gap_s": "s", "link_mass_share": "", "rotation_wxyz": "",
        "episodes": "",
    }.items():  # fmt: skip
        assert range_of(key).unit == unit, key
    assert range_of("capsule_radius_m").high == 10
    assert range_of("rate_hz").low == 1


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("longest_gap_s", 1e300, "expected -100000 to 100000 s"),
        ("miss_per_m", 1e300, "expected -1e.06 to 1e.06"),
        ("rate_hz", 1e-38, "expected 1 to 10000 Hz"),
        ("mass_kg", 1e-300, "expected 0 to 10000 kg"),
        ("position_deg", (-57_300.0, 0.0), "expected -57296 to 57296 degrees"),
        ("seed", 2**32, "expected 0 to"),
        ("distances_m", {"a": {"b": 1e6}}, "expected -1000 to 1000 m"),
        ("name", "a\x1b[31m", r"has the control character U\+001B"),
        ("markers", {"a\nb": ("c",)}, r"has the control character U\+000A"),
        ("recordings", ("x" * (LONGEST_TEXT + 1),), "4097 characters, expected at most 4096"),
    ],
)
def test_what_is_beyond_says_what_would_be_allowed(key, value, message):
    with pytest.raises(ValueError, match=message):
        check_values(key, value)


@pytest.mark.parametrize(
    ("key", "value"),
    [("longest_gap_s", 0), ("mass_kg", SMALLEST), ("yaw", True), ("assumed", "two\nlines"),
     ("margin_s", 1e5), ("objects", None)],
)  # fmt: skip
def test_what_is_in_range_passes(key, value):
    check_values(key, value)


def test_line_and_key_are_named(tmp_path):
    path = tmp_path / "mine.yaml"
    text = (TOP / "pipelines" / "ur5_stick_throw.yaml").read_text()
    path.write_text(text.replace("margin_s: 0.2", "margin_s: 1.0e+300"))
    line = 1 + text[: text.index("margin_s:")].count("\n")
    with pytest.raises(BesmanError, match=rf"mine.yaml:{line}: margin_s: got 1e\+300; expected"):
        load_pipeline(path)
    path.write_text(text.replace("\nlabel:\n", "\nlabel:\n  longest_gap_s: 1.0e+300\n"))
    with pytest.raises(BesmanError, match=r"yaml:11: label.longest_gap_s: got 1e\+300; expected"):
        load_pipeline(path)


def test_a_config_made_in_python_is_held_to_it_too():
    with pytest.raises(ValidationError, match="expected -100000 to 100000 s"):
        LabelConfig(longest_gap_s=1e6)


@pytest.mark.parametrize(
    ("config", "changes", "message"),
    [
        (JointConfig, {"position_deg": (-1e5, 1e5)}, "expected -57296 to 57296 degrees"),
        (JointConfig, {"name": "=1+1"}, "the name begins with '='"),
        (JointConfig, {"name": "a\nb"}, "the name has the control character"),
        (ToolConfig, {"mass_kg": -1}, "greater than or equal to 0"),
        (ToolConfig, {"mass_kg": 1e5}, "expected 0 to 10000 kg"),
        (ToolConfig, {"capsule_radius_m": 11}, "expected 0 to 10 m"),
    ],
)
def test_an_arm_that_nobody_builds(config, changes, message):
    joint = {
        "name": "a", "position_deg": (-90, 90), "velocity_deg_s": 90, "acceleration_rad_s2": 5,
        "torque_nm": 50, "home_deg": 0,
    }  # fmt: skip
    content = joint if config is JointConfig else {}
    config.model_validate(content)
    with pytest.raises(ValidationError, match=message):
        config.model_validate(content | changes)


def test_what_comes_with_besman_is_in_range():
    for path in TOP.glob("pipelines/*.yaml"):
        load_pipeline(path)
    for path in TOP.glob("configs/tasks/*.yaml"):
        (load_whole_task if is_whole_task(path.stem) else load_task)(path.stem)
    for path in TOP.glob("configs/markers/*.yaml"):
        load_marker_set(path.stem)
    for path in TOP.glob("robots/*/robot.yaml"):
        load_robot(path.parent.name)


def test_the_page_shows_both_tables():
    page = (TOP / "docs" / "reference" / "valid_ranges.md").read_text()
    for table in ("besman.config.ranges:RANGES", "besman.foreign.urdf_text:RANGES"):
        assert f"{{table-of}} {table}" in page
