import numpy as np
import pinocchio
import pytest

from besman.geometry.joint_axis import joint_axis

TILTED = np.array([0.6, 0.0, -0.8])
KINDS = {
    "hinge": pinocchio.JointModelRY(),
    "tilted hinge": pinocchio.JointModelRevoluteUnaligned(TILTED),
    "endless hinge": pinocchio.JointModelRUBZ(),
    "tilted endless hinge": pinocchio.buildModelFromXML(
        "<robot name='a'><link name='b'/><link name='c'/><joint name='d' type='continuous'>"
        "<parent link='b'/><child link='c'/><axis xyz='0.6 0 -0.8'/></joint></robot>"
    ).joints[1],
    "slide": pinocchio.JointModelPX(),
    "tilted slide": pinocchio.JointModelPrismaticUnaligned(TILTED),
}


@pytest.mark.parametrize("name", KINDS)
def test_it_is_the_column_of_the_joints_own_jacobian(name):
    model = pinocchio.Model()
    placement = pinocchio.SE3(pinocchio.rpy.rpyToMatrix(0.3, -0.4, 1.1), np.array([0.1, 0.2, 0.3]))
    for number in range(2):
        model.addJoint(number, KINDS[name], placement, f"joint {number}")
    data = model.createData()
    pinocchio.computeJointJacobians(model, data, pinocchio.neutral(model))
    column = pinocchio.getJointJacobian(model, data, 2, pinocchio.LOCAL)[:, 1]
    np.testing.assert_allclose(np.concatenate(joint_axis(model.joints[2])), column, atol=1e-12)


@pytest.mark.parametrize("joint", [pinocchio.JointModelFreeFlyer(), pinocchio.JointModelPlanar()])
def test_other_joints_have_no_axis(joint):
    model = pinocchio.Model()
    model.addJoint(0, joint, pinocchio.SE3.Identity(), "free")
    with pytest.raises(ValueError, match="expected a hinge or a slide"):
        joint_axis(model.joints[1])
