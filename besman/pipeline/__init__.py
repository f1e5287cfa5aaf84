"""The pipeline: its config, the stages in their order, the run folder and finished runs."""
