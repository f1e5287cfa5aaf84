"""What an arm's own executions say of its servos and joints."""
