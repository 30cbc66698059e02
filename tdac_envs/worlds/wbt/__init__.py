"""Webots world files: text → nodes → frames → prisms → `World`."""
