"""The picture of person and robot, of a throw that is made up."""

import re
from dataclasses import replace

import numpy as np
from people import person

from besman.report.overview import overview
from besman.robot.kinematics import forward_kinematics
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.refine.stage import CmaEsConfig

MARKERS = ("back_top", "back_left", "back_right", "shoulder", "elbow", "hand_top",
           "hand_left", "hand_right", "box_back")  # fmt: skip


def curves(drawing):
    """Return the lines of a drawing as points, those of one marker or more."""
    found = re.findall(r'<path d="([^"]*)"', drawing)
    return [re.findall(r"[ML] (\S+) (\S+)", path) for path in found]


def test_person_and_robot_are_drawn_at_eight_instants(robot, make_plan):
    recording, truth = person("a.tsv", 0, list(MARKERS), MARKERS[5:8])
    task = load_task("stick_throw")
    plan = make_plan()
    (trial,) = try_plans(robot, task, [plan])
    (motion,) = CmaEsConfig(episodes=1, robustness=None).run(
        (replace(plan, target=trial.outcome),), robot, task
    )
    bounds = tuple(truth.bounds[0].tolist())
    drawing = overview(recording, bounds, "box_back", robot, motion, np.eye(4))
    assert f"robot: ur5, miss {100 * motion.miss:.1f} cm" in drawing
    assert "person: a.tsv" in drawing
    # Back, shoulder, elbow, hand; base, joints, tool: as many points a posture.
    lengths = [len(curve) for curve in curves(drawing)]
    assert lengths.count(4) >= 8
    assert lengths.count(robot.n + 1) >= 8
    mirrored = overview(recording, bounds, None, robot, motion, np.diag([-1.0, -1, 1, 1]))
    assert mirrored != drawing
    assert np.isfinite(forward_kinematics(robot.chain, motion.positions[-1])).all()
