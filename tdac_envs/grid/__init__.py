"""Occupancy grids: distances to obstacles, shortest paths, metres."""
