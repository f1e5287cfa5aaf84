"""The axis of a joint of a Pinocchio model, as the model itself says it."""

from __future__ import annotations

from typing import Any

import numpy as np

from besman.records import FloatArray


def joint_axis(joint: Any) -> tuple[FloatArray, FloatArray]:
    """Return the directions in which a joint of one degree of freedom shifts and turns.

    Parameters
    ----------
    joint : pinocchio.JointModel
        A hinge, with an end or without, or a slide, along an axis of its frame or any other.

    Returns
    -------
    linear, angular : array, shape (3,)
        In the joint's frame; zero for what it does not do. Together the joint's motion subspace.

    Raises
    ------
    ValueError
        If it is another joint.
    """
    import pinocchio

    if joint.nv != 1:
        raise ValueError(f"{joint.shortname()}: expected a hinge or a slide")
    # By itself in a model, as not every kind gives its axis away.
    model = pinocchio.Model()
    model.addJoint(0, joint, pinocchio.SE3.Identity(), "alone")
    data = model.createData()
    pinocchio.computeJointJacobians(model, data, pinocchio.neutral(model))
    column = np.array(pinocchio.getJointJacobian(model, data, 1, pinocchio.LOCAL)).reshape(6)
    return column[:3], column[3:]
