"""Simulate a scene in Drake; what comes of it is said as MuJoCo says it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.exceptions import VerificationError, in_one_line
from besman.simulation.physics import SimulatedStates
from besman.simulation.second_engine.drake_scene import DrakeScene, as_transform, load_drake

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# As often as in `besman.simulation.physics` is asked whether an end is reached.
_CHUNK_STEPS = 50


def run_drake(
    scene: DrakeScene,
    start: FloatArray,
    controls: FloatArray,
    finished: Callable[[SimulatedStates, slice], BoolArray],
    look: Callable[[Any], tuple[FloatArray, FloatArray, FloatArray]],
    thing: tuple[Any, FloatArray] | None = None,
) -> SimulatedStates:
    """Simulate one movement from rest.

    Parameters
    ----------
    scene : DrakeScene
        Finished.
    start : array, shape (n,)
        Joint angles, rad.
    controls : array, shape (T, n)
        Set-points of the servos at every step of the task, rad.
    finished : callable
        As in `besman.simulation.physics.run_physics`.
    look : callable
        Gives of a context of the plant what MuJoCo calls qpos, qvel and sensors.
    thing : free body and its pose, shape (4, 4), optional
        In the world, metres.

    Returns
    -------
    SimulatedStates
        Of one simulation, B = 1.

    Raises
    ------
    VerificationError
        If Drake cannot go on.
    """
    simulator = load_drake().analysis.Simulator(scene.diagram)
    context = scene.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    scene.plant.SetPositions(context, scene.arm, start)
    if thing is not None:
        body, pose = thing
        scene.plant.SetFloatingBaseBodyPoseInWorldFrame(context, body, as_transform(pose))
    asked = scene.plant.get_desired_state_input_port(scene.arm)
    widths = (len(part) for part in look(context))
    qpos, qvel, sensors = (np.full((1, len(controls), width), np.nan) for width in widths)
    run = SimulatedStates(qpos, qvel, sensors, np.zeros(1, dtype=np.int64))
    try:
        for brake in scene.brakes:
            scene.plant.get_desired_state_input_port(brake).FixValue(context, np.zeros(2))
        asked.FixValue(context, scene.asked_state(controls[0]))
        simulator.Initialize()
        for begin in range(0, len(controls), _CHUNK_STEPS):
            span = slice(begin, min(begin + _CHUNK_STEPS, len(controls)))
            for step in range(span.start, span.stop):
                asked.FixValue(context, scene.asked_state(controls[step]))
                simulator.AdvanceTo((step + 1) * scene.time_step_s)
                run.qpos[0, step], run.qvel[0, step], run.sensors[0, step] = look(context)
            run.steps[0] = span.stop
            if finished(run, span)[0]:
                break
    except RuntimeError as error:
        raise VerificationError(f"drake cannot go on: {in_one_line(error)}") from None
    return run
