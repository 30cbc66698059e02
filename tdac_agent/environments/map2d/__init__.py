"""TDAC-Map2D-v0: its tasks, pictures and surroundings."""
