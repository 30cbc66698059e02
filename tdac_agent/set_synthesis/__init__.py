"""Writing a controller for a task set: the loop, its tests, and the selection."""
