from people import make_person, one_arm

__all__ = ["make_person", "one_arm"]
