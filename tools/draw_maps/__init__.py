"""Draws the bundled maps."""
