import re

from besman.report.stage_tables import stage_tables
from besman.report.timing import THESIS_HUMAN_SECONDS, THESIS_SECONDS, THESIS_THROWS


def stage(name, wall_s, human=False, **more):
    return {
        "name": name, "wall_s": wall_s, "cpu_s": wall_s, "human": human, "items": 10,
        "unit": "item", "cached": False, "peak_rss_mb": 100.0, "computed_wall_s": wall_s, **more,
    }  # fmt: skip


def rows(text):
    return [
        [re.sub("<[^>]*>", "", cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row)]
        for row in re.findall(r"<tr>(.*?)</tr>", text, re.DOTALL)
    ]


def test_machine_time_is_held_against_the_thesis_scaled_to_the_demonstrations():
    name = next(iter(THESIS_SECONDS))
    timing = {
        "total_wall_s": 6.0,
        "stages": [
            stage(name, 2.0),
            stage("export", 4.0, workers={"n": 3, "peak_rss_mb": 50.0}),
            stage("looking", 60.0, human=True),
        ],
    }
    text = stage_tables(timing, {"map": {"n_demonstrations": 10}}, {"label": {"method": "named"}})
    found = {row[0]: row for row in rows(text) if row}
    factor = THESIS_SECONDS[name] * 10 / THESIS_THROWS / 2.0
    assert f"{factor:.3g} x" in found[name]
    assert found["export"][-1] == "100 + 3 x 50"
    assert found["looking"][1] == "60.0 s" or "1" in found["looking"][1]
    assert set(THESIS_HUMAN_SECONDS) <= found.keys()
    assert found["naming markers by hand"][1] == "names came with the recordings"


def test_what_a_person_has_to_look_at_is_counted():
    timing = {"total_wall_s": 0.0, "stages": []}
    config = {"label": {"method": "trajectories"}, "recognize": {"examples_per_class": 3}}
    text = stage_tables(timing, {"label": {"review": ["a", "b"]}}, config)
    found = {row[0]: row[1] for row in rows(text) if len(row) == 3}
    assert found["naming markers by hand"] == "none: automatic; 2 trajectories to look at"
    assert found["labelling movements by hand"] == "not measured; 3 examples of each class"


def test_names_of_the_files_themselves_are_not_called_automatic():
    timing = {"total_wall_s": 0.0, "stages": []}
    config = {"label": {"method": "trajectories"}}
    for found, said in ((0, "names came with the recordings"), (1, "none: automatic")):
        names = [{"recording": "a.tsv", "taken": 9, "found": found}]
        text = stage_tables(timing, {"label": {"names": names}}, config)
        assert {row[0]: row[1] for row in rows(text) if row}["naming markers by hand"] == said


def test_great_factors_are_written_out():
    name = next(iter(THESIS_SECONDS))
    timing = {"total_wall_s": 1.0, "stages": [stage(name, THESIS_SECONDS[name] / 12345.0)]}
    results = {"map": {"n_demonstrations": THESIS_THROWS}}
    assert any("12345 x" in row for row in rows(stage_tables(timing, results, {})))
