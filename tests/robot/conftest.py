from homes import all_poses, few_poses  # noqa: F401
