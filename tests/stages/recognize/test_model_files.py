import json

import numpy as np
import pytest

from besman.exceptions import RecognitionError
from besman.records.files import save_record
from besman.stages.recognize.model import name_segments
from besman.stages.recognize.model_files import load_model, save_model
from besman.stages.recognize.stage import CONFIGS, RecognizeConfig

METHODS = {"nearest_neighbour": "sklearn", "dtw": "tslearn", "hmm": "hmmlearn", "lstm": "torch"}


@pytest.fixture(scope="module")
def trained(one_arm):
    return RecognizeConfig().train(*one_arm)


@pytest.mark.parametrize("method", METHODS)
def test_a_stored_model_gives_the_same_answers(method, one_arm, tmp_path):
    pytest.importorskip(METHODS[method])
    recordings, truth = one_arm
    model = CONFIGS[method]().train(recordings, truth)
    arrays, about = save_model(model, tmp_path / "deep" / "model.npz")
    loaded = load_model(about)
    first = name_segments(model, recordings[0], truth[0].bounds)
    second = name_segments(loaded, recordings[0], truth[0].bounds)
    assert first[0] == second[0]
    np.testing.assert_array_equal(first[1], second[1])
    assert arrays.stat().st_size < 500_000
    content = json.loads(about.read_text())
    assert content["features"] == list(model.recipe.features)
    assert len(content["data_sha256"]) == 64
    assert content["classes"] == {"forward": 5, "idle": 5, "left": 5, "up": 5}


def test_the_same_data_gives_the_same_bytes(trained, one_arm, tmp_path):
    again = RecognizeConfig().train(*one_arm)
    one, _ = save_model(trained, tmp_path / "one")
    two, _ = save_model(again, tmp_path / "two")
    assert one.read_bytes() == two.read_bytes()


def test_nothing_is_overwritten(trained, tmp_path):
    save_model(trained, tmp_path / "model")
    with pytest.raises(RecognitionError, match=r"model.npz: is there already"):
        save_model(trained, tmp_path / "model.json")


def test_a_folder_that_is_a_file_is_refused(trained, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RecognitionError, match="cannot be written"):
        save_model(trained, tmp_path / "file" / "model")


def test_what_is_no_model_is_refused(trained, tmp_path):
    arrays, about = save_model(trained, tmp_path / "model")
    with pytest.raises(RecognitionError, match=r"other.json: cannot be read: No such file"):
        load_model(tmp_path / "other")
    (tmp_path / "text.json").write_text("{")
    with pytest.raises(RecognitionError, match=r"text.json: is not JSON"):
        load_model(tmp_path / "text")
    (tmp_path / "list.json").write_text("[]")
    with pytest.raises(RecognitionError, match=r"list.json: is no model; expected format 'besman"):
        load_model(tmp_path / "list")
    (tmp_path / "alone.json").write_text(about.read_text())
    with pytest.raises(RecognitionError, match=r"alone.npz: no such file; it belongs beside alone"):
        load_model(tmp_path / "alone")
    data = bytearray(arrays.read_bytes())
    data[100] ^= 255
    arrays.write_bytes(bytes(data))
    with pytest.raises(RecognitionError, match=r"model.npz: is damaged or not the one that model"):
        load_model(arrays)


def test_a_record_of_another_kind_is_refused(trained, tmp_path):
    import hashlib

    arrays, about = save_model(trained, tmp_path / "model")
    for content, message in (
        (trained.recipe, "holds a Recipe; expected a model"),
        (None, "cannot"),
    ):
        if content is None:
            arrays.write_bytes(b"nothing")
        else:
            save_record(content, arrays)
        described = json.loads(about.read_text())
        described["sha256"] = hashlib.sha256(arrays.read_bytes()).hexdigest()
        about.write_text(json.dumps(described))
        with pytest.raises(RecognitionError, match=message):
            load_model(arrays)


def test_a_model_that_is_asked_for_again_is_read_once(trained, tmp_path):
    arrays, about = save_model(trained, tmp_path / "one")
    assert load_model(about) is load_model(arrays)
    arrays.write_bytes(arrays.read_bytes()[:-1])
    with pytest.raises(RecognitionError, match="damaged"):
        load_model(about)
