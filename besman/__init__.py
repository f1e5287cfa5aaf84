"""besman: from a person's recorded movement to a robot's."""

__version__ = "0.1.0"
