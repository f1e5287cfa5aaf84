"""What the processes of a run load before they are asked. Loads nothing itself."""

PRELOAD = (
    "scipy.interpolate",
    "besman.stages.map.map_demonstrations",
    "besman.stages.refine.gauss_newton",
    "besman.stages.refine.search_loop",
    "besman.stages.refine.plan_space",
    "besman.stages.refine.robustness",
    "besman.simulation.tasks.stick_throw.stick_throw",
    "besman.stages.export.motion_exports",
    "mujoco.rollout",
    "besman.stages.refine.rehearsal",
)
"""Modules that processes need for nearly every run: mapping, refinement, exports."""
