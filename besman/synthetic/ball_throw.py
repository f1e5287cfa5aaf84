"""How simulated people throw a ball (thesis 3.5): skill and style differ more than with a stick."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from besman.synthetic.throw_motion import Style, draw_style


def draw_ball_style(rng: np.random.Generator) -> Style:
    """Draw how a person throws a ball from above, from beginner to ball player."""
    style = draw_style(rng)
    skill = rng.uniform(0.0, 1.0)
    return replace(
        style,
        strike_pose=style.strike_pose + rng.uniform(-0.05, 0.05, 3) + [-0.02 * skill, 0.0, 0.04],
        throw_pose=style.throw_pose + rng.uniform(-0.05, 0.05, 3),
        speed_mps=style.speed_mps + 0.5 * skill,
        strike_s=style.strike_s * rng.uniform(0.75, 1.25),
        hold_s=0.25 * (1.0 - skill) - 0.05,
        swing_s=style.swing_s * rng.uniform(0.8, 1.2),
        overlap=style.overlap + 0.08 * skill,
        stick_elevation_deg=style.stick_elevation_deg + rng.uniform(-8.0, 8.0, 2),
        twist=style.twist * (1.0 + skill),
    )
