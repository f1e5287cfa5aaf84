#!/usr/bin/env bash
# Drake 1.51 and 1.58: in the lagged contact approximation, a stiff rod that strikes a wall obliquely loses more speed along
# the wall than across it, although the coefficient of friction is 0.05.
#
# Friction is bounded by the normal force that stiffness and approach speed make before the step, not by the impulse that
# ends the approach within it. With kSimilar and kSap the loss along is 0.05 times the loss across.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
# For Python 3.11 the last release is 1.51.1. Nothing of Mosek's or of pydot is used.
release=$(python3 -c 'import sys; print("1.51.1" if sys.version_info < (3, 12) else "1.58.0")')
python3 -m pip install --quiet --disable-pip-version-check --no-deps --target "$place/packages" \
    "drake==$release" numpy==2.4.6 >"$place/pip.log" 2>&1 || { cat "$place/pip.log"; exit 1; }
cd "$place"
PYTHONPATH=$place/packages python3 - <<'PY'
import sys
from importlib.metadata import version

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    Capsule,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
)
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

FRICTION, RADIUS, LENGTH = 0.05, 0.006, 0.438


def strike(approximation):
    """Return how much speed a rod loses across and along a wall, without gravity."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0005)
    plant.set_contact_model(ContactModel.kHydroelastic)
    plant.set_discrete_contact_approximation(approximation)
    plant.mutable_gravity_field().set_gravity_vector([0, 0, 0])
    material = {"dissipation": 20.0, "friction": CoulombFriction(FRICTION, FRICTION)}
    soft, hard = ProximityProperties(), ProximityProperties()
    AddCompliantHydroelasticProperties(0.003, 5e8, soft)
    AddRigidHydroelasticProperties(0.01, hard)
    AddContactMaterial(properties=soft, **material)
    AddContactMaterial(properties=hard, **material)
    inertia = SpatialInertia.SolidCapsuleWithMass(0.06, RADIUS, LENGTH, [0, 0, 1])
    rod = plant.AddRigidBody("rod", plant.AddModelInstance("rod"), inertia)
    capsule = Capsule(RADIUS, LENGTH)
    plant.RegisterCollisionGeometry(rod, RigidTransform(), capsule, "rod", soft)
    wall = RigidTransform([-0.003 - RADIUS - 0.0005, 0, 0])
    plant.RegisterCollisionGeometry(plant.world_body(), wall, Box(0.006, 0.2, 2), "wall", hard)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    start = np.array([-0.25, 0, 2.4])
    moving = SpatialVelocity(np.zeros(3), start)
    plant.SetFreeBodySpatialVelocity(context=context, body=rod, V_JpJc=moving)
    simulator.AdvanceTo(0.01)
    end = plant.EvalBodySpatialVelocityInWorld(context, rod).translational()
    return end[0] - start[0], start[2] - end[2]


print("drake", version("drake"))
for name in ("kSap", "kSimilar", "kLagged"):
    across, along = strike(getattr(DiscreteContactApproximation, name))
    print(f"{name}: {across:.3f} m/s less across the wall, {along:.3f} m/s along: ratio {along / across:.3f}")
    if (along / across > 1.0) != (name == "kLagged"):
        sys.exit("changed: another approximation takes more than friction does")
PY
