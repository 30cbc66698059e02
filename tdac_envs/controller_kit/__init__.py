"""The files that each controller gets with its task."""
