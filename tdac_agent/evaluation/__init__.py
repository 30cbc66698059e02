"""Evaluation of policies of any kind on the same tasks and seeds."""
