"""Policies of any kind on the same tasks, from the same seeds."""
