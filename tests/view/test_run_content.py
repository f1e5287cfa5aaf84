"""What a page is given, against the records it comes from."""

import gzip
import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from besman.exceptions import RunError
from besman.geometry.frames import back_frame
from besman.records.files import load_record, save_record
from besman.report.run_records import load_records
from besman.robot.kinematics import forward_kinematics
from besman.view import decimation
from besman.view.decimation import Mesh, decimate
from besman.view.outcome_words import motion_words
from besman.view.packing import Packer
from besman.view.run_content import RunContent


def unpack(bundle):
    """Read a bundle as besman/view/page/bundle.js does."""
    whole = gzip.decompress(bundle)
    length = int.from_bytes(whole[:4], "little")
    numbers = np.frombuffer(whole, "<i2", offset=4 + length)

    def resolve(node):
        if isinstance(node, list):
            return [resolve(one) for one in node]
        if not isinstance(node, dict):
            return node
        if "at" in node and "shape" in node:
            size = int(np.prod(node["shape"]))
            part = numbers[node["at"] : node["at"] + size].reshape(node["shape"])
            if not size:
                return np.empty(node["shape"])
            if "step" not in node:
                return np.cumsum(part.astype(np.uint16), axis=0, dtype=np.uint16)
            values = np.cumsum(part, axis=0, dtype=np.int16)
            return np.where(values == -32768, np.nan, node["step"] * values)
        return {key: resolve(one) for key, one in node.items()}

    return resolve(json.loads(whole[4 : 4 + length]))


def record(folder, stage):
    return load_record(next(folder.glob(f"[0-9][0-9]_{stage}")) / "record.npz")


def test_packed_arrays_come_back_to_the_rounding():
    rng = np.random.default_rng(1)
    values = rng.normal(size=(50, 4, 3)) * 3
    values[7:9, 2] = np.nan
    indices = rng.integers(0, 65536, (30, 3))
    packer = Packer()
    bundle = packer.bundle({"v": packer.add(values), "i": packer.add_indices(indices)})
    found = unpack(bundle)
    assert (np.isnan(found["v"]) == np.isnan(values)).all()
    step = np.nanmax(np.abs(values)) / 32766
    assert np.nanmax(np.abs(found["v"] - values)) <= 0.5001 * step
    assert (found["i"] == indices).all()
    packer = Packer()
    assert packer.bundle({"v": packer.add(values), "i": packer.add_indices(indices)}) == bundle


def test_takes_are_the_records(content, small_run):
    motions = {one.plan.name: one for one in record(small_run, "refine")}
    mapped = {one.name: one for one in record(small_run, "map").trajectories}
    for index, name in enumerate(content.names):
        motion = motions[name]
        (arm,) = unpack(content.demonstration(index))["arms"]
        takes = arm["takes"]
        assert [one["episode"] for one in takes] == [-1, *(at for at, _ in motion.milestones)]
        np.testing.assert_allclose(takes[0]["joints"][-1], mapped[name].positions[-1], atol=3e-4)
        last = takes[-1]
        assert last["success"] == motion.success
        assert last["miss"] == pytest.approx(motion.miss)
        # The servos follow the plan to within 3 degrees, or the episode has failed.
        time = last["start"] + last["interval"] * np.arange(len(last["joints"]))
        during = time < motion.time[-1]
        wanted = np.array([np.interp(time[during], motion.time, q) for q in motion.positions.T]).T
        assert np.abs(last["joints"][during] - wanted).max() < 0.05
        np.testing.assert_allclose(last["object"][-1], motion.object_path[-1], atol=2e-3)
        miss = np.linalg.norm(last["object"][-1][:2] - arm["target"][:2])
        assert miss == pytest.approx(motion.miss, abs=5e-3)
        np.testing.assert_allclose(arm["path"], mapped[name].poses[:, :3], atol=2e-4)


def test_the_span_of_the_imitation_is_the_demonstration(content, small_run):
    robot = content._arms[0].robot
    mapped = {one.name: one for one in record(small_run, "map").trajectories}
    for index, name in enumerate(content.names):
        (arm,) = unpack(content.demonstration(index))["arms"]
        imitated = arm["takes"][1]
        trajectory = mapped[name]
        for at, moment in zip(imitated["span"], (0, -1), strict=True):
            row = round((at - imitated["start"]) / imitated["interval"])
            tip = forward_kinematics(robot.chain, imitated["joints"][row])[:3, 3]
            demonstrated = forward_kinematics(robot.chain, trajectory.positions[moment])[:3, 3]
            # A frame is up to 5 ms off at up to 3 m/s.
            assert np.linalg.norm(tip - demonstrated) < 0.03


def test_the_person_stands_where_the_mapping_put_them(content, small_run):
    recording = record(small_run, "label")[0]
    segments = record(small_run, "recognize")[0]
    mapping = record(small_run, "map")
    for index, name in enumerate(content.names):
        found = unpack(content.demonstration(index))
        person, (arm,) = found["person"], found["arms"]
        start = segments.bounds[int(name.rpartition(":")[2]), 0]
        row = round(-person["start"] / person["interval"])
        markers = person["markers"][row]
        rotation, origin = back_frame(
            *(recording.marker(part)[start] for part in ("back_top", "back_left", "back_right"))
        )
        in_back = (recording.positions[start] - origin) @ rotation
        world = in_back @ mapping.placement[:3, :3].T + mapping.placement[:3, 3]
        turn, shift = arm["yaw"], np.array(arm["shift"])
        c, s = np.cos(turn), np.sin(turn)
        shown = markers @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        shown += shift - [0, 0, arm["backHeight"]]
        np.testing.assert_allclose(shown, world, atol=3e-4)
        # The demonstrated path of the hand goes through the hand's markers.
        hand = [person["names"].index(f"hand_{part}") for part in ("top", "left", "right")]
        assert np.linalg.norm(markers[hand].mean(axis=0) - arm["hand"][0]) < 0.01


def test_what_was_left_out_is_listed_with_its_reason(small_run, tmp_path):
    folder = copy_run(small_run, tmp_path)
    path = next(folder.glob("*_map")) / "record.npz"
    mapping = load_record(path)
    gone = mapping.trajectories[0].name
    save_record(replace(mapping, trajectories=mapping.trajectories[1:]), path)
    motions = record(folder, "refine")
    save_record(motions[1:], next(folder.glob("*_refine")) / "record.npz")
    results = json.loads((folder / "results.json").read_text())
    results["map"]["failed"] = [{"name": gone, "reason": '</script><b>too far & "away"'}]
    (folder / "results.json").write_text(json.dumps(results))
    content = RunContent(folder)
    line = unpack(content.overview())["demonstrations"][content.find(gone)]
    assert line["status"] == "left out"
    assert line["reason"] == 'map: </script><b>too far & "away"'
    found = unpack(content.demonstration(content.find(gone)))
    assert found["arms"][0]["takes"] == []
    assert np.isfinite(found["person"]["markers"]).any()


def copy_run(folder, tmp_path):
    return shutil.copytree(folder, tmp_path / "run")


def test_a_run_that_is_not_finished(small_run, tmp_path):
    folder = copy_run(small_run, tmp_path)
    state = json.loads((folder / "run.json").read_text())
    state |= {"status": "failed", "error": "map: unreachable"}
    (folder / "run.json").write_text(json.dumps(state))
    with pytest.raises(
        RunError, match=r"not finished .status 'failed': map: unreachable.; expected"
    ):
        RunContent(folder)


def test_a_folder_that_is_no_run_or_has_nothing_mapped(small_run, tmp_path):
    with pytest.raises(RunError, match=r"not a run: run\.json is missing"):
        RunContent(tmp_path)
    folder = copy_run(small_run, tmp_path)
    (next(folder.glob("*_map")) / "record.npz").unlink()
    with pytest.raises(RunError, match="no demonstration was mapped to an arm: nothing to show"):
        RunContent(folder)
    (folder / "pipeline.yaml").unlink()
    with pytest.raises(RunError, match=r"not a run: pipeline\.yaml is missing"):
        RunContent(folder)


def test_names_that_are_not_there(content):
    with pytest.raises(RunError, match=r"--motion: no motion 'x'; .*allowed"):
        content.find("x")
    with pytest.raises(RunError, match=f"no demonstration 9: there are {len(content.names)}"):
        content.demonstration(9)


def test_decimation_keeps_the_shape():
    around = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    up = np.linspace(-1, 1, 60)
    vertices = np.array(
        [
            [np.cos(a) * np.sqrt(1 - z * z), np.sin(a) * np.sqrt(1 - z * z), z]
            for z in up
            for a in around
        ]
    )
    rows, columns = np.meshgrid(np.arange(59), np.arange(120), indexing="ij")
    a = (120 * rows + columns).ravel()
    b = (120 * rows + (columns + 1) % 120).ravel()
    triangles = np.concatenate([np.stack([a, b, b + 120], 1), np.stack([a, b + 120, a + 120], 1)])
    ball = Mesh(vertices, triangles)
    (fewer,) = decimate([ball], 2000)
    assert 800 < len(fewer.triangles) <= 2000
    radii = np.linalg.norm(fewer.vertices, axis=1)
    assert radii.min() > 0.95
    assert radii.max() < 1.0 + 1e-9
    corners = fewer.vertices[fewer.triangles]
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("fi,fi->f", outwards, corners.mean(axis=1)) > 0).mean() > 0.97
    assert decimate([ball], len(triangles)) == [ball]


def merge_plainly(mesh, cell):
    """Replace the vertices in each cell by their mean, one after the other."""
    keys = [tuple(row) for row in np.floor(mesh.vertices / cell).astype(int).tolist()]
    cells = sorted(set(keys))
    means = [np.mean([v for v, k in zip(mesh.vertices, keys, strict=True) if k == one], axis=0)
             for one in cells]  # fmt: skip
    found = set()
    for triangle in mesh.triangles:
        corners = [cells.index(keys[vertex]) for vertex in triangle]
        if len(set(corners)) == 3:
            least = corners.index(min(corners))
            found.add((*corners[least:], *corners[:least]))
    return means, sorted(found)


@pytest.mark.parametrize(("size_m", "cell"), [(1.0, 0.8), (1.0, 1e-3), (1e7, 1e-3), (1.0, 100.0)])
def test_cells_of_a_grid_are_merged_as_one_after_the_other(size_m, cell):
    random = np.random.default_rng(0)
    mesh = Mesh(random.normal(size=(40, 3)) * size_m, random.integers(0, 40, (300, 3)))
    found = decimation._merge(mesh, cell)
    means, triangles = merge_plainly(mesh, cell)
    expected = np.array([[means[corner] for corner in one] for one in triangles]).reshape(-1, 3, 3)
    np.testing.assert_allclose(found.vertices[found.triangles], expected, rtol=1e-12)


def test_terminal_page_and_replay_give_one_reason(small_run):
    motion = load_records(small_run)["refine"][0]
    lost = replace(
        motion, miss=float("nan"), failure_after="arm did not follow", miss_before=0.3, failure=""
    )
    assert motion_words(lost) == "arm did not follow (imitated: 30.0 cm off the target)"
    never = replace(lost, failure_after="", handed_over="steps stall")
    assert motion_words(never) == (
        "no outcome (imitated: 30.0 cm off the target); CMA-ES went on, as steps stall"
    )
    near = replace(motion, miss=0.012, failure_after="limit exceeded", failure="never released")
    near = replace(near, miss_before=float("nan"))
    assert motion_words(near) == (
        "1.2 cm off the target, but limit exceeded (imitated: never released)"
    )
