"""From a `task.yaml` to a feasible task."""
