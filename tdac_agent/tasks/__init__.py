"""Tasks: from a `task.yaml` to a feasible task."""
