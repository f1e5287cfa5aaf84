"""The frozen records that flow between the stages. SI units; NaN means not seen.

Arrays are copied, made read-only and checked once, at construction.
"""

from besman.records.block_demonstrations import BlockDemonstration
from besman.records.failure import Failure
from besman.records.frozen import FloatArray, Record, ShapeError, freeze
from besman.records.landing import Landing
from besman.records.plans import AnyPlan, CartesianPlan, MotionPlan
from besman.records.recordings import Axis, LabelledRecording, Origin, Recording
from besman.records.refined_motion import RefinedMotion
from besman.records.segments import Actions, LabelledSegments, Segments
from besman.records.task_trial import RefinedTask, TaskTrial
from besman.records.trajectories import HandTrajectory, JointTrajectory
from besman.records.whole_tasks import BlockPlan, MappedTask, TaskPlan

__all__ = [
    "Actions",
    "AnyPlan",
    "Axis",
    "BlockDemonstration",
    "BlockPlan",
    "CartesianPlan",
    "Failure",
    "FloatArray",
    "HandTrajectory",
    "JointTrajectory",
    "LabelledRecording",
    "LabelledSegments",
    "Landing",
    "MappedTask",
    "MotionPlan",
    "Origin",
    "Record",
    "Recording",
    "RefinedMotion",
    "RefinedTask",
    "Segments",
    "ShapeError",
    "TaskPlan",
    "TaskTrial",
    "freeze",
]
