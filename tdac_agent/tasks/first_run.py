"""Compilation of the kernels, once per machine."""

from __future__ import annotations

from tdac_agent.tasks.environment import Environment
from tdac_envs.core.code_cache import cache_folder, has_code


def compile_first(environment: Environment) -> None:
    """Compiles an environment's kernels unless compiled code is cached.

    This reports progress; the judge, which would compile most of them, would not.
    """
    if not has_code(environment.kernels) and cache_folder() is not None:
        environment.use_kernels()
