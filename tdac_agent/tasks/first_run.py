"""What is done once on a machine, before anything else takes time."""

from __future__ import annotations

from tdac_envs.core.code_cache import cache_folder, has_code


def compile_first(package: str) -> None:
    """Compiles the kernels of an environment on its first run of all, where it is said.

    Else the judge would do most of it, where nobody sees why it takes so long.

    Args:
        package: That has its kernels: `tdac_envs.map2d` or `tdac_envs.epuck`.
    """
    if not has_code(package) and cache_folder() is not None:
        from tdac_agent.environments import kernels_used

        if package == "tdac_envs.map2d":
            kernels_used.use_map_kernels()
        else:
            kernels_used.use_world_kernels()
