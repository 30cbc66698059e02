"""What controllers are written for: a single task, or a task set."""
