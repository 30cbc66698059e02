"""The judge's process: it runs a suite over a controller."""
