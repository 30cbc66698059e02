"""Converts a map picture to an occupancy grid and its parameters."""
