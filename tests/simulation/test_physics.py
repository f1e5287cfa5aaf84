import mujoco
import numpy as np

from besman.simulation.physics import run_physics

MODEL = mujoco.MjModel.from_xml_string(
    """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody><body>
    <joint name="hinge" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/>
    <site name="tip" pos=".3 0 0"/></body></worldbody><actuator><motor joint="hinge"/></actuator>
    <sensor><framepos objtype="site" objname="tip"/></sensor></mujoco>"""
)


def never(run, span):
    return np.zeros(len(run.steps), dtype=bool)


def test_is_a_plain_loop_over_steps():
    controls = np.random.default_rng(0).normal(size=(3, 250, 1))
    start = np.array([[0.0], [1.0], [2.0]])
    run = run_physics(MODEL, start, controls, never)
    for index in range(3):
        data = mujoco.MjData(MODEL)
        data.qpos[:] = start[index]
        for step in range(250):
            data.ctrl[:] = controls[index, step]
            mujoco.mj_step(MODEL, data)
            np.testing.assert_allclose(run.qpos[index, step], data.qpos, atol=1e-12)
            mujoco.mj_kinematics(MODEL, data)
            np.testing.assert_allclose(run.sensors[index, step], data.site("tip").xpos, atol=1e-12)
    assert (run.steps == 250).all()


def test_stops_what_is_finished_without_touching_the_others():
    controls = np.zeros((2, 350, 1))
    start = np.array([[0.0], [1.0]])

    def first_one_soon(run, span):
        return np.array([span.stop >= 200, False])

    run = run_physics(MODEL, start, controls, first_one_soon)
    np.testing.assert_array_equal(run.steps, [200, 350])
    assert np.isnan(run.qpos[0, 200:]).all()
    whole = run_physics(MODEL, start, controls, never)
    np.testing.assert_array_equal(run.qpos[1], whole.qpos[1])
    np.testing.assert_array_equal(run.qpos[0, :200], whole.qpos[0, :200])


def test_an_explosion_ends_by_itself_and_leaves_no_log(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    controls = np.zeros((2, 1000, 1))
    controls[0] = 1e300
    run = run_physics(MODEL, np.zeros((2, 1)), controls, never)
    assert run.steps[1] == 1000
    assert np.isfinite(run.qpos[1]).all()
    assert not list(tmp_path.iterdir())
