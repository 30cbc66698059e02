"""Verification: a suite is run over a controller on a task, and gives a report."""
