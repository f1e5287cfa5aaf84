import pytest

from besman.exceptions import ConfigError
from besman.simulation.tasks import ReachConfig, StickThrowConfig, load_task


def test_shipped_tasks_are_the_defaults():
    assert load_task("stick_throw") == StickThrowConfig(kind="stick_throw")
    assert load_task("reach") == ReachConfig(kind="reach")


def test_own_file(tmp_path):
    path = tmp_path / "near.yaml"
    path.write_text("kind: stick_throw\nsuccess: {success_radius_m: 0.02}\n")
    task = load_task(str(path))
    assert task.success_radius_m == 0.02
    assert task.rest_s == task.simulation.longest_wait_s
    assert load_task("reach").rest_s == load_task("reach").simulation.settling_s


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kind: stick_trow\n", r"own.yaml:1: kind: got 'stick_trow'; did you mean 'stick_throw'"),
        ("tool: gripper\n", r"own.yaml: kind: got None; allowed: reach, stick_throw"),
        ("kind: reach\nrewards: {}\n", r"own.yaml:2: unknown key 'rewards'; did you mean 'reward'"),
        (
            "kind: stick_throw\nstick:\n  mass_kg: 0\n",
            r"own.yaml:3: stick.mass_kg: got 0; input should be greater than 0",
        ),
        (
            "kind: stick_throw\nsimulation: {contact_time_s: 0.001}\n",
            r"own.yaml:2: simulation: .*at least two time steps",
        ),
    ],
)
def test_errors_name_file_line_and_what_is_allowed(tmp_path, text, message):
    path = tmp_path / "own.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message):
        load_task(str(path))


def test_missing_task():
    with pytest.raises(ConfigError, match="no file and no resource named 'throw'; did you mean"):
        load_task("throw")
