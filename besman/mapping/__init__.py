"""From a person's hand to a robot's joints: record mapping and embodiment mapping."""
