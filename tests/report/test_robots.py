import io
import json
from types import SimpleNamespace

from rich.console import Console

from besman.pipeline.retarget import Retargeted
from besman.report.robots import retargeted_table


def plan(tmp_path, name, miss):
    folder = tmp_path / name
    folder.mkdir()
    results = {
        "map": {
            "n_transferred": 3,
            "n_demonstrations": 4,
            "position_error_m": {"mean": 0.0012, "p95": 0.0034, "max": 0.0056},
            "time_stretch": {"median": 1.25, "max": 2.0},
        },
        "refine": {"n_success": 2, "n_motions": 3, "miss_m": {"median": miss, "max": miss}},
    }
    (folder / "results.json").write_text(json.dumps(results))
    (folder / "run.json").write_text(json.dumps({"status": "done"}))
    (folder / "timing.json").write_text(json.dumps({"total_wall_s": 12.0, "stages": []}))
    return SimpleNamespace(name=name, folder=folder)


def test_every_robot_is_a_row_and_one_that_failed_says_so(tmp_path):
    done = (
        Retargeted(plan(tmp_path, "ur5", 0.021)),
        Retargeted(plan(tmp_path, "ur10", None)),
        Retargeted(plan(tmp_path, "compi", 0.0), ValueError("no")),
    )
    console = Console(width=200, file=io.StringIO())
    console.print(retargeted_table(done))
    lines = [line.split() for line in console.file.getvalue().splitlines()]
    rows = {cells[0]: " ".join(cells[1:]) for cells in lines if cells}
    assert rows["ur5"] == "3 of 4 1.2 3.4 5.6 1.25 2 of 3 2.1 cm 12.0 s"
    assert rows["ur10"] == "3 of 4 1.2 3.4 5.6 1.25 2 of 3 - 12.0 s"
    assert rows["compi"] == "failed"
