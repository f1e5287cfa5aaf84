"""Batches of simulations, each stopped as soon as its outcome is known."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from besman.robot.mujoco_log import silence_mujoco
from besman.simulation.perturbation import Perturbation, perturb_controls, perturb_model

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_CHUNK_STEPS = 50
_KEPT = threading.local()


def spare_data(model: mujoco.MjModel) -> mujoco.MjData:
    """Return data of a model for this thread to work in, with whatever is left there.

    To make them takes as long as fifty steps.
    """
    import mujoco

    kept: tuple[mujoco.MjModel, mujoco.MjData] | None = getattr(_KEPT, "pair", None)
    if kept is None or kept[0] is not model:
        _KEPT.pair = kept = (model, mujoco.MjData(model))
    return kept[1]


@dataclass(frozen=True, eq=False)
class SimulatedStates:
    """States of B simulations after each of at most T steps; NaN after a simulation was stopped.

    Attributes
    ----------
    qpos : array, shape (B, T, nq)
    qvel : array, shape (B, T, nv)
    sensors : array, shape (B, T, ns)
        Of the same moment as the states.
    steps : int array, shape (B,)
        Steps that were made.
    """

    qpos: FloatArray
    qvel: FloatArray
    sensors: FloatArray
    steps: npt.NDArray[np.int64]


def run_physics(
    model: mujoco.MjModel,
    initial_qpos: FloatArray,
    controls: FloatArray,
    finished: Callable[[SimulatedStates, slice], BoolArray],
    perturbations: Sequence[Perturbation] = (),
    initial_qvel: FloatArray | None = None,
) -> SimulatedStates:
    """Simulate a batch, from rest or as it goes on.

    Results do not depend on the batch: every simulation starts afresh and is looked at after the
    same steps. MuJoCo works without Python's lock, so that several batches can run in threads.

    Parameters
    ----------
    model : mujoco.MjModel
        What is simulated.
    initial_qpos : array, shape (B, nq)
        Where the simulations start.
    controls : array, shape (B, T, nu)
        Controls of every step.
    finished : callable
        Given the run so far, in which NaN stands for what was not simulated, and the steps that
        are new, tells which simulations (B,) need not go on.
    perturbations : sequence of Perturbation
        One for each simulation; none: the world is as the model says.
    initial_qvel : array, shape (B, nv), optional
        How fast they are then; by default at rest.

    Returns
    -------
    SimulatedStates
        A diverged simulation has states that are not finite.
    """
    import mujoco
    import mujoco.rollout

    from besman.simulation.no_clock import stop_clock

    silence_mujoco()
    stop_clock()
    batch, steps, n_controls = controls.shape
    assert n_controls == model.nu
    state = np.zeros((batch, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    state[:, 1 : 1 + model.nq] = initial_qpos
    if initial_qvel is not None:
        state[:, 1 + model.nq : 1 + model.nq + model.nv] = initial_qvel
    run = SimulatedStates(
        qpos=np.full((batch, steps, model.nq), np.nan),
        qvel=np.full((batch, steps, model.nv), np.nan),
        sensors=np.full((batch, steps, model.nsensordata), np.nan),
        steps=np.zeros(batch, dtype=np.int64),
    )
    data = [spare_data(model)]
    models = [perturb_model(model, one) for one in perturbations]
    if perturbations:
        step = model.opt.timestep
        pairs = zip(controls, perturbations, strict=True)
        controls = np.stack([perturb_controls(*pair, step) for pair in pairs])
    active = np.arange(batch)
    with mujoco.rollout.Rollout(nthread=0) as rollout:
        for first in range(0, steps, _CHUNK_STEPS):
            span = slice(first, min(first + _CHUNK_STEPS, steps))
            # MuJoCo gives the sensors of the state before a step: one more step, kept off the
            # states, gives those of the last state.
            chunk = controls[active, span]
            chunk = np.concatenate([chunk, chunk[:, -1:]], axis=1)
            worlds = [models[row] for row in active] if models else [model] * len(active)
            states, sensors = _roll_out(rollout, worlds, data, state[active], chunk)
            run.qpos[active, span] = states[:, :-1, 1 : 1 + model.nq]
            run.qvel[active, span] = states[:, :-1, 1 + model.nq : 1 + model.nq + model.nv]
            run.sensors[active, span] = sensors[:, 1:]
            run.steps[active] = span.stop
            state[active] = states[:, -2]
            going_on = np.isfinite(state).all(axis=1) & ~finished(run, span)
            active = active[going_on[active]]
            if not len(active):
                break
    return run


def _roll_out(
    rollout: mujoco.rollout.Rollout,
    worlds: Sequence[mujoco.MjModel],
    data: Sequence[mujoco.MjData],
    state: FloatArray,
    controls: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Simulate every step of a batch; return its states and sensors.

    MuJoCo does not look through what is made here: with one simulation in the batch that would
    take a tenth of its time.
    """
    batch, steps, _ = controls.shape
    states = np.empty((batch, steps, state.shape[1]))
    sensors = np.empty((batch, steps, worlds[0].nsensordata))
    rollout.rollout(
        worlds,
        data,
        state,
        controls,
        skip_checks=True,
        nstep=steps,
        state=states,
        sensordata=sensors,
    )
    return states, sensors
