"""`tdac warm`: compiles everything ahead, for this user or for all users."""

from __future__ import annotations

from rich.markup import escape

from tdac_agent.cli.console import Console
from tdac_agent.tasks.registry import own_environments
from tdac_envs.core.code_cache import cache_folder


def run() -> int:
    """Compiles all kernels; returns 3 if compiled code cannot be cached, else 0."""
    for environment in own_environments():
        environment.use_kernels()
    folder = cache_folder()
    if folder is not None:
        line = f"compiled code is cached in {escape(str(folder))}"
        Console().print(line, highlight=False, soft_wrap=True)
    return 3 if folder is None else 0
