"""What is done once on a machine, before anything else takes time."""

from __future__ import annotations

from tdac_agent.tasks.environment import Environment
from tdac_envs.core.code_cache import cache_folder, has_code


def compile_first(environment: Environment) -> None:
    """Compiles an environment's kernels on its first run, where progress is reported.

    Else the judge would compile most of them, and nothing would say why it takes long.
    """
    if not has_code(environment.kernels) and cache_folder() is not None:
        environment.use_kernels()
