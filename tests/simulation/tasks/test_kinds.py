import pytest

from besman.exceptions import ConfigError
from besman.robot.model import load_robot
from besman.simulation.task import SimulationConfig, Task
from besman.simulation.tasks import kinds
from besman.simulation.tasks.kinds import KINDS, TaskKind, load_task
from besman.simulation.tasks.reach.reach import simulate_reaching
from besman.simulation.trial import try_plans


def test_a_file_alone_makes_another_task(tmp_path):
    path = tmp_path / "golf.yaml"
    path.write_text(
        "kind: ball_throw\ntarget_m: [1.5, -0.4]\nball: {radius_m: 0.0214, mass_kg: 0.0459}\n"
        "reward: {miss_per_m: 2}\nsuccess: {success_radius_m: 0.03}\n"
    )
    task = load_task(str(path))
    assert task.target_m == (1.5, -0.4)
    assert task.ball.mass_kg == 0.0459
    assert task.reward.miss_per_m == 2
    assert task.scoop == load_task("ball_throw").scoop
    assert task.success_radius_m == 0.03


class HoldStillConfig(Task):
    """A kind in one file: the less the arm's tool moves, the better."""

    kind: str = "hold_still"
    tool: str = "gripper"
    simulation: SimulationConfig = SimulationConfig()

    @property
    def rest_s(self):
        return 0.1

    def target(self, plan):
        return plan.goal_pose[:3]

    def simulate(self, robot, plans, movements, paths):
        reach = load_task("reach")
        return simulate_reaching(robot, reach, movements)


def test_a_new_kind_is_a_class_and_a_line(tmp_path, monkeypatch, make_plan):
    class Here(TaskKind):
        def load(self):
            return HoldStillConfig

    entry = Here("hold_still", "", "the arm alone", "the movement", "end pose")
    monkeypatch.setattr(kinds, "KINDS", (*KINDS, entry))
    path = tmp_path / "still.yaml"
    path.write_text("kind: hold_still\nreward: {miss_per_m: 3}\n")
    task = load_task(str(path))
    robot = load_robot("ur5", "gripper")
    (trial,) = try_plans(robot, task, [make_plan(1.2)])
    assert trial.failure == ""
    assert trial.reward == -3 * trial.miss == -sum(trial.costs.values())


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
        (
            "tool: gripper\n",
            r"own.yaml: kind: got None; allowed: ball_throw, .*, reach, rearrange, stick_throw",
        ),
        ("kind: reach\nrewards: {}\n", r"own.yaml:2: unknown key 'rewards'; did you mean 'reward'"),
        (
            "kind: stick_throw\nstick:\n  mass_kg: 0\n",
            r"own.yaml:3: stick.mass_kg: got 0; input should be greater than 0",
        ),
        (
            "kind: stick_throw\nsimulation: {contact_time_s: 0.001}\n",
            r"own.yaml:2: simulation: .*at least two time steps",
        ),
        (
            "kind: grasp_box\nsimulation: {time_step_s: 0.005}\n",
            r"own.yaml:2: simulation: .*at least two time steps of 0.005 s",
        ),
        (
            "kind: pull_lever\nlever: {pull_deg: 170}\n",
            r"own.yaml:2: lever.pull_deg: got 170; input should be less than 170",
        ),
        (
            "kind: ball_throw\nscoop: {wall_deg: 10}\n",
            r"own.yaml:2: scoop.wall_deg: got 10; input should be greater than or equal to 20",
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
