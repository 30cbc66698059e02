"""The executors by their names."""

from __future__ import annotations

from typing import Any

from tdac_agent.executors.executor import Executor
from tdac_agent.executors.local import run_locally


def executor_of(name: str) -> Executor[Any, Any]:
    """The executor `local` or `ray`."""
    if name == "ray":
        from tdac_agent.executors.on_ray import run_on_ray  # an extra

        return run_on_ray
    return run_locally
