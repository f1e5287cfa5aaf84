"""The simulated datasets, by name; nothing heavy is imported, so that help texts can name them."""

from __future__ import annotations

DATASET_NOTES = {
    "step": "",
    "lever": "",
    "pick_and_place": "",
    "ball_throw": "",
    "stick_throw": "",
    "stick_throw_unmarked": "no stick seen",
    "stick_throw_marked": "small",
    "gestures": "",
    "object_rotation": "",
    "circle_drawing": "",
    "rotation": "",
}
"""What is to be known of each of `besman.synthetic.datasets.DATASETS` before it is chosen."""
