"""`tdac warm`: compiles everything ahead, for this user or for all of a machine."""

from __future__ import annotations

from rich.markup import escape

from tdac_agent.cli.console import Console
from tdac_agent.tasks.registry import own_environments
from tdac_envs.core.code_cache import cache_folder


def run() -> int:
    """Compiles what is not compiled yet; 3 where it cannot be kept."""
    for environment in own_environments():
        environment.use_kernels()
    folder = cache_folder()
    if folder is not None:
        told = f"compiled code lies ready in {escape(str(folder))}"
        Console().print(told, highlight=False, soft_wrap=True)
    return 3 if folder is None else 0
