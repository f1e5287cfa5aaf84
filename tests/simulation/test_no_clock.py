import mujoco

from besman.simulation.no_clock import stop_clock

PENDULUM = """<mujoco><worldbody><body><joint type="hinge"/><geom size="0.1" pos="0 0 -1"/></body>
</worldbody></mujoco>"""


def test_mujoco_does_not_time_its_steps():
    stop_clock()
    model = mujoco.MjModel.from_xml_string(PENDULUM)
    data = mujoco.MjData(model)
    for _ in range(20):
        mujoco.mj_step(model, data)
    step = data.timer[mujoco.mjtTimer.mjTIMER_STEP]
    assert (step.number, step.duration) == (20, 0.0)
