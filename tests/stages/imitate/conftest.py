from demonstrated_motions import configs, demonstrate, plan_of, robots

__all__ = ["configs", "demonstrate", "plan_of", "robots"]
