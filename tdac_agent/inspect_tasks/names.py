"""Names in Inspect's registry: `tdac_agent/NAME`, installed in whatever way."""

from __future__ import annotations

from inspect_ai.solver import Generate, Solver, TaskState, solver
from inspect_ai.util import registry_info

PACKAGE = "tdac_agent"
"""Name of the entry point, which is that of the package."""


@solver
def _probe() -> Solver:
    async def solve(state: TaskState, generate: Generate) -> TaskState:  # noqa: ARG001
        return state

    return solve


# Inspect puts the package before the names of what is in `site-packages`. In a clone
# it does not: it looks for a distribution with the name of the package, but that of
# `tdac_agent` is called `tdac`.
_IS_PREFIXED = registry_info(_probe).name.startswith(f"{PACKAGE}/")


def registered(name: str) -> str:
    """The name to register something under, so that it becomes `tdac_agent/NAME`."""
    return name if _IS_PREFIXED else f"{PACKAGE}/{name}"
