"""What the processes of a run load to draw a report's figures. Loads nothing itself."""

DRAWING = (
    "matplotlib.backends.backend_svg",
    "matplotlib.figure",
    "besman.report.figures",
    "besman.report.motion_figures",
    "besman.report.overview",
)
"""Modules that processes need for the figures of a report."""
