"""Webots world files: text → nodes → frames → prisms → `tdac_envs.world.World`."""
