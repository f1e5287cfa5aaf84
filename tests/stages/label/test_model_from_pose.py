import numpy as np

from besman.person.marker_set import load_marker_set
from besman.stages.label.model import signed_volumes
from besman.stages.label.model_from_pose import model_from_pose


def test_the_model_is_that_of_the_pose():
    marker_set = load_marker_set("right_arm")
    model = model_from_pose(marker_set)
    pose = np.array([marker_set.pose_m[name] for name in model.markers])
    given = {frozenset((a, b)) for a, others in marker_set.distances_m.items() for b in others}
    clusters = [set(names) for names in marker_set.clusters.values()]
    steadiness = {"stuck": [], "limb": [], "free": []}
    for i, a in enumerate(model.markers):
        for j, b in enumerate(model.markers[:i]):
            if frozenset((a, b)) not in given:
                assert np.isclose(model.distance[i, j], np.linalg.norm(pose[i] - pose[j]))
            stuck = any({a, b} <= names for names in clusters)
            kind = "stuck" if stuck else "limb" if frozenset((a, b)) in given else "free"
            steadiness[kind].append(model.spread[i, j] / (0.1 + model.distance[i, j]))
    assert max(steadiness["stuck"]) < min(steadiness["limb"])
    assert max(steadiness["limb"]) < min(steadiness["free"])
    np.testing.assert_allclose(model.distance, model.distance.T)
    assert len(model.quads) > 0
    np.testing.assert_allclose(signed_volumes(pose, model.quads), model.volume)
