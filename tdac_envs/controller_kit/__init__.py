"""The files that a controller gets beside its task."""
