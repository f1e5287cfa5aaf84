import json

import numpy as np
import pytest
from small_runs import keep_demonstrations

from besman.config.resources import find_resource
from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.records.files import load_record
from besman.report.page import write_page
from besman.synthetic.datasets import write_synthetic


@pytest.mark.slow
def test_what_both_hands_do_becomes_what_both_arms_do(tmp_path, monkeypatch, undrawn):
    keep_demonstrations(monkeypatch, 2)
    write_synthetic("object_rotation", tmp_path / "recordings", 1, 3, seed=5)
    settings = (
        f"recordings={tmp_path / 'recordings'}", "refine.episodes=10", "map.evaluations=30",
        "map.yaw=false", "refine.robustness={models: 3}",
    )  # fmt: skip
    config = load_pipeline(find_resource("pipelines", "rh5_two_arms"), settings)
    folder = run_pipeline(config, tmp_path / "run", jobs=2)
    results = json.loads((folder / "results.json").read_text())
    for stage in ("map", "map_second"):
        assert results[stage]["n_transferred"] == results[stage]["n_demonstrations"] == 2
        assert results[stage]["limit_violations"] == results[stage]["self_collisions"] == 0
    for stage in ("refine", "refine_second"):
        assert results[stage]["n_motions"] == 2
    mappings = load_record(next(folder.glob("*_map")) / "record.npz")
    for first, second in zip(*(mapping.trajectories for mapping in mappings), strict=True):
        assert first.name == second.name
        assert first.time[-1] == pytest.approx(second.time[-1], rel=1e-6)
    first, second = (
        sorted((folder / name).glob("*[0-9].csv")) for name in ("exports", "exports_second")
    )
    assert [path.name for path in first] == [path.name for path in second]
    columns = [paths[0].read_text().splitlines()[0] for paths in (first, second)]
    assert "right_elbow" in columns[0]
    assert "left_elbow" in columns[1]
    assert np.isfinite(results["refine"]["miss_m"]["median"])
    page = write_page(folder).read_text()
    assert "rh5_two_arms" in page
    for arm in ("rh5_right, right hand", "rh5_left, left hand"):
        for heading in ("Demonstrated and executed paths", "Every demonstration"):
            assert f"<h2>{heading} ({arm})</h2>" in page
    assert page.count('<table class="sortable">') == 2
    name = sorted((folder / "exports_second").glob("*[0-9].csv"))[0].name
    assert f'href="exports_second/{name}"' in page
