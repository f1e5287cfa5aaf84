"""Bringing an arm in: from the file that describes it to a robot.yaml."""
