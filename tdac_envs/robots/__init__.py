"""Robots by name: a file for each, with the source of every figure."""
