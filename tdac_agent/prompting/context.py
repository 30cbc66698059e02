"""Variables of the prompt templates."""

from __future__ import annotations

import math
from typing import Any

from tdac_agent.prompting.extract import POLICY
from tdac_agent.prompting.manual import interface_of
from tdac_agent.sandbox import Limits
from tdac_agent.tasks.task import Task
from tdac_agent.verification.suite.contract import ALLOWED_IMPORTS
from tdac_agent.verification.suite.hygiene import (
    FORBIDDEN_ATTRIBUTES,
    FORBIDDEN_CALLS,
    SAVERS,
    SURFACES,
)


def context_of(task: Task) -> dict[str, Any]:
    """Returns the template variables of a task.

    They describe the nominal task only, not the jittered starts or the tests.
    """
    return {**_of_any(task), **task.environment.prompt_facts(task)}


def _of_any(task: Task) -> dict[str, Any]:
    nominal, progress = task.nominal, task.spec.progress
    interface, limits = interface_of(task.setting.observed()), Limits()
    return {
        "environment": task.spec.env,
        "env_description": interface.description,
        "observation_table": interface.observation,
        "action_text": interface.action,
        **allowed_code({"__future__"}),
        "names": task.environment.names,
        "dt": f"{nominal.dt:g}",
        "dt_ms": f"{1000 * nominal.dt:g}",
        "import_seconds": f"{limits.import_seconds:g}",
        "reset_seconds": f"{limits.reset_seconds:g}",
        "call_seconds": f"{limits.call_seconds:g}",
        "cpu_seconds": f"{limits.cpu_seconds:g}",
        "profile": task.spec.profile,
        "progress_steps": task.progress_steps,
        "full_way": task.progress_steps * nominal.full_step,
        "progress_fraction": f"{progress.fraction:g}",
        "progress_distance": {
            "geodesic": "length of the shortest free path",
            "euclidean": "straight line",
        }[progress.distance],
        "movers_text": "",
        "horizon": nominal.horizon,
        "straight": math.dist(nominal.start[:2], nominal.goal),
        "shortest": nominal.shortest,
        "instructions": task.spec.instructions.strip(),
    }


def allowed_code(not_supplied: set[str]) -> dict[str, str]:
    """Returns the template variables of what a controller may import and call.

    Args:
        not_supplied: Allowed modules that it does not get, or need not import.
    """
    return {
        "allowed_imports": " ".join(sorted(ALLOWED_IMPORTS - not_supplied)),
        "forbidden_calls": ", ".join(sorted(FORBIDDEN_CALLS)),
        "forbidden_attributes": ", ".join(sorted(FORBIDDEN_ATTRIBUTES)),
        "savers": ", ".join(sorted(SAVERS)),
        "surfaces": ", ".join(sorted(SURFACES)),
    }


def contract_of(task: Task) -> tuple[str, ...]:
    """Returns the names that a controller of a task must define at its top level."""
    if task.spec.profile != "paper":
        return (POLICY,)
    names = task.environment.names
    return (POLICY, *names.constants, *names.functions, *names.classes)
