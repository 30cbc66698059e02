"""Occupancy grids: distances to obstacles, shortest paths, map frames."""
