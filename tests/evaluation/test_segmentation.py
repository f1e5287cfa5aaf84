import functools
import json

import numpy as np
import pytest
from places import REAL_DATA, SAMPLE
from typer.testing import CliRunner

from besman.cli.main import app
from besman.evaluation.dmp_settings import SETTINGS, score_settings
from besman.evaluation.segmentation import (
    bootstrap_mean,
    choose_methods,
    cluster_accuracy,
    evaluate_segmentation,
    make_method,
)
from besman.evaluation.segmentation_data import read_dataset, simulate_dataset
from besman.evaluation.segmentation_figures import draw_recording
from besman.evaluation.segmentation_tables import segmentation_tables
from besman.exceptions import ConfigError, RecordingError
from besman.records import LabelledSegments
from besman.stages.segment.methods import CONFIGS
from besman.synthetic import sequenced_dmps


def labelled(bounds, labels, source="a.tsv"):
    return LabelledSegments(np.array(bounds), labels, np.zeros(len(labels)), 10.0, source)


def test_clusters_are_matched_to_labels_by_time():
    truth = labelled([[0, 10], [10, 30], [12, 20]], ("reach", "throw", "throw_part"))
    found = labelled([[0, 12], [12, 30]], ("cluster1", "cluster2"))
    assert cluster_accuracy((found,), (truth,)) == pytest.approx(28 / 30)
    swapped = labelled([[0, 12], [12, 30]], ("cluster2", "cluster1"))
    assert cluster_accuracy((swapped,), (truth,)) == pytest.approx(28 / 30)
    one = labelled([[0, 30]], ("cluster1",))
    assert cluster_accuracy((one,), (truth,)) == pytest.approx(20 / 30)
    assert np.isnan(cluster_accuracy((one,), (labelled(np.empty((0, 2), int), ()),)))


def test_the_bootstrap_interval_covers_the_mean_and_has_a_seed():
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(200):
        low, high = bootstrap_mean(rng.normal(size=40), 1)
        covered += low <= 0.0 <= high
    assert 180 <= covered <= 199
    assert bootstrap_mean([0.1, 0.9, 0.4], 3) == bootstrap_mean([0.1, 0.9, 0.4], 3)


def test_methods_are_chosen_by_name():
    assert choose_methods(None) == tuple(CONFIGS)
    assert choose_methods(["mci", "mci"]) == ("mci",)
    with pytest.raises(ConfigError, match="no method 'locmn'; did you mean 'locmin'"):
        choose_methods(["locmn"])
    assert make_method("locmin", {"rate_hz": 30.0, "n_weights": 3}).rate_hz == 30.0


def test_there_are_48_settings():
    assert len(set(SETTINGS)) == 48


def test_settings_are_scored():
    movements = sequenced_dmps.generate_sequenced_dmps()[:2]
    shares = []
    figures = score_settings(movements, "vmci", make_method("vmci", {}), 0.2, shares.append)
    assert figures["n_settings"] == 48
    assert shares[-1] == 1.0
    assert figures["f1_lowest"] <= figures["f1"] <= figures["f1_highest"] <= 1.0
    assert figures["f1"] == pytest.approx(np.mean(figures["f1_by_recording"]))
    once = score_settings(movements, "locmin", make_method("locmin", {}), 0.2, shares.append)
    assert (once["n_settings"], once["f1"]) == (1, 1.0)


def test_recordings_of_a_folder_are_measured_alone(monkeypatch):
    quick = functools.partial(CONFIGS["bp_ar_hmm"], sweeps=5)
    quick.model_fields = CONFIGS["bp_ar_hmm"].model_fields
    monkeypatch.setitem(CONFIGS, "bp_ar_hmm", quick)
    result = evaluate_segmentation(SAMPLE, ["locmin", "bp_ar_hmm"], 0.2, source="synthetic")
    assert result["experiment"] == "segmentation"
    row, clustered = result["rows"]
    assert (row["dataset"], row["source"], row["method"]) == ("stick_throw", "synthetic", "locmin")
    assert row["f1_low"] <= row["f1"] <= row["f1_high"]
    assert row["tp_end"] == row["tp"] + 1
    assert row["n_recordings"] == len(row["recordings"]) == 2
    assert row["thesis"] == {
        "table": "4.3",
        "f1": 0.71,
        "tp": 2.0,
        "fp": 1.8,
        "measured_on": "other data",
    }
    assert row["accuracy"] is None
    assert 0.0 < clustered["accuracy"] <= 1.0
    assert segmentation_tables(result["rows"])[0].row_count == 2


def test_the_command_prints_a_table_and_writes_its_rows(tmp_path):
    rows, figures = tmp_path / "rows.json", tmp_path / "figures"
    arguments = ["evaluate", "segmentation", "--data", str(SAMPLE), "--methods", "locmin,mci"]
    arguments.append("--synthetic")
    run = CliRunner().invoke(app, [*arguments, "--json", str(rows), "--figures", str(figures)])
    assert run.exit_code == 0, run.output
    assert "other data" in run.output
    assert [row["method"] for row in json.loads(rows.read_text())["rows"]] == ["locmin", "mci"]
    drawn = sorted(path.name for path in figures.iterdir())
    assert drawn == ["stick_throw_synthetic_subject1.png", "stick_throw_synthetic_subject2.png"]
    assert (figures / drawn[0]).read_bytes().startswith(b"\x89PNG")


def test_a_figure_has_a_panel_for_each_method_and_one_for_the_posterior():
    movement = sequenced_dmps.generate_sequenced_dmps()[0]
    recordings = (movement.recording(),)
    segments = {
        name: make_method(name, {}).run(recordings)[0] for name in ("valley_vmci", "locmin")
    }
    figure = draw_recording(recordings[0], movement.truth(), segments)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    expected = ["manual", "valley_vmci", "locmin", "valley_vmci: probability of a border"]
    assert [title for title in titles if title] == expected


def test_bad_input(tmp_path):
    with pytest.raises(ConfigError, match="margin_s: got -1; must not be negative"):
        evaluate_segmentation(margin_s=-1)
    (tmp_path / "a.tsv").write_bytes((SAMPLE / "subject1.tsv").read_bytes())
    with pytest.raises(RecordingError, match="none of 1 recordings has manual segments"):
        read_dataset(tmp_path)
    with pytest.raises(ConfigError, match="no dataset 'no_such_dataset'"):
        simulate_dataset("no_such_dataset")


@pytest.mark.slow
def test_the_default_keeps_its_figures_on_real_recordings():
    folder = REAL_DATA / "pick_and_place"
    if not folder.is_dir():
        pytest.skip(f"no real recordings in {folder}; set BESMAN_REAL_DATA")
    rows = evaluate_segmentation(folder, ["valley_vmci", "vmci", "locmin"])["rows"]
    f1 = {row["method"]: row["f1"] for row in rows}
    assert f1["valley_vmci"] > 0.92
    assert f1["valley_vmci"] > f1["locmin"] > f1["vmci"] > 0.64
