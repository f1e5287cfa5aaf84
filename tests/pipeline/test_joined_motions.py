import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from besman.cli.main import app
from besman.exceptions import PlanError, RunError
from besman.io.exports import read_joint_csv
from besman.pipeline import joined_motions
from besman.pipeline.finished_run import read_run
from besman.pipeline.joined_motions import join_motions


def test_motions_of_a_run_are_joined(small_run, tmp_path):
    motion = read_run(small_run).motions[0]
    names = [motion.plan.name] * 2
    out = tmp_path / "joined"
    done = CliRunner().invoke(app, ["join", str(small_run), *names, "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "2 motions in" in done.output
    assert "0 in self-collision" in done.output
    asked = json.loads((out / "limits.json").read_text())["joined"]
    time, positions, _, _ = read_joint_csv(out / "joined.csv")
    assert asked["starts_s"][0] == 0
    assert asked["motions"] == names
    assert asked["rests_at_ends"] is True
    np.testing.assert_allclose(positions[[0, -1]], motion.positions[[0, -1]], atol=1e-9)
    assert time[-1] == pytest.approx(asked["duration_s"])
    row = round(1e3 * asked["starts_s"][1]) + len(motion.time) // 2
    np.testing.assert_allclose(positions[row], motion.positions[len(motion.time) // 2], atol=1e-9)
    with pytest.raises(RunError, match="no motion 'nobody:1'"):
        join_motions(small_run, ["nobody:1"], tmp_path / "b", 0.2)
    assert not (tmp_path / "b").exists()


def test_what_is_beyond_a_limit_is_not_joined(small_run, tmp_path, monkeypatch):
    finished = read_run(small_run)
    motion = finished.motions[0]
    fast = np.array(motion.velocities)
    fast[len(fast) // 2] = 1.01 * finished.robot.limits.velocity
    changed = replace(finished, motions=(replace(motion, velocities=fast),))
    monkeypatch.setattr(joined_motions, "read_run", lambda _: changed)
    with pytest.raises(PlanError, match=r"not written: beyond the limit of velocity in 1 of \d+"):
        join_motions(small_run, [motion.plan.name], tmp_path / "c", 0.2)
    assert not (tmp_path / "c").exists()
