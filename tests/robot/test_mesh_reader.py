"""Meshes that are read once."""

import numpy as np
import pinocchio
from scipy.spatial import ConvexHull

from besman.robot.mesh_reader import MeshReader, triangles_of

CORNERS = np.array(np.meshgrid([0, 1], [0, 2], [0, 3])).reshape(3, 8).T
URDF = """<robot name="boxes"><link name="a">SHAPES</link></robot>"""
SHAPE = '<collision><geometry><mesh filename="FILE" scale="SCALE"/></geometry></collision>'


def test_a_file_and_scale_is_one_mesh_with_the_triangles_that_coal_has(tmp_path):
    faces = ConvexHull(CORNERS).simplices
    file = tmp_path / "box.obj"
    lines = ["v {} {} {}".format(*one) for one in CORNERS]
    file.write_text("\n".join(lines + ["f {} {} {}".format(*(one + 1)) for one in faces]) + "\n")
    shapes = [SHAPE.replace("FILE", str(file)).replace("SCALE", one) for one in ("1 1 1", "2 2 2")]
    text = URDF.replace("SHAPES", "".join([*shapes, shapes[0]]))
    model, reader = pinocchio.buildModelFromXML(text), MeshReader()
    kind = pinocchio.GeometryType.COLLISION
    found = []
    for _ in range(2):
        geometry = pinocchio.buildGeomFromUrdfString(model, text, kind, mesh_loader=reader.loader)
        found.append([reader.same(item) for item in geometry.geometryObjects])
    assert found[0][0] is found[0][2] is found[1][0] is found[1][2]
    assert found[0][1] is found[1][1]
    assert found[0][0] is not found[0][1]
    mesh = found[0][0]
    expected = [[mesh.tri_indices(face)[corner] for corner in range(3)] for face in range(12)]
    np.testing.assert_array_equal(triangles_of(mesh), expected)
    assert triangles_of(mesh) is triangles_of(mesh)
    assert np.ptp(found[0][1].vertices(), axis=0).max() == 2 * np.ptp(mesh.vertices(), axis=0).max()
