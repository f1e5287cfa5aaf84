from contact_motions import approach, grasper, level_scoop, pull, puller, scoop_throw, scooper

__all__ = ["approach", "grasper", "level_scoop", "pull", "puller", "scoop_throw", "scooper"]
