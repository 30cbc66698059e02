"""Robot controllers that are written, tested and repaired until they are verified."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tdac_agent.disturbance import Disturbance
    from tdac_agent.evaluation import evaluate
    from tdac_agent.evaluation_report import Evaluation
    from tdac_agent.history import Told, gather_run
    from tdac_agent.policy import Policy, load_controller
    from tdac_agent.records import Run, load_run
    from tdac_agent.report import Report
    from tdac_agent.robust import verify_robust
    from tdac_agent.synthesis import synthesize
    from tdac_agent.task import Task, load_task
    from tdac_agent.verification import verify

__all__ = [
    "Disturbance",
    "Evaluation",
    "Policy",
    "Report",
    "Run",
    "Task",
    "Told",
    "evaluate",
    "gather_run",
    "load_controller",
    "load_run",
    "load_task",
    "synthesize",
    "verify",
    "verify_robust",
]

_HOME = {
    "Disturbance": "disturbance",
    "Evaluation": "evaluation_report",
    "Policy": "policy",
    "Report": "report",
    "Run": "records",
    "Task": "task",
    "Told": "history",
    "evaluate": "evaluation",
    "gather_run": "history",
    "load_controller": "policy",
    "load_run": "records",
    "load_task": "task",
    "synthesize": "synthesis",
    "verify": "verification",
    "verify_robust": "robust",
}


def __getattr__(name: str) -> Any:
    """Imports a part on first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'tdac_agent' has no attribute {name!r}")
    return getattr(import_module(f"tdac_agent.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    """What there is, imported yet or not."""
    return sorted({*globals(), *__all__})
