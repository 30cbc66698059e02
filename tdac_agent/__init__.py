"""Write, test and repair robot controllers until they are verified."""

# No module is imported here: see `tdac_agent.interpreter`.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from tdac_agent.evaluation.evaluate import evaluate
    from tdac_agent.evaluation.evaluation_report import Evaluation
    from tdac_agent.evaluation.policy import Policy, load_controller
    from tdac_agent.runs.history import RunHistory, gather_run
    from tdac_agent.runs.ownership import load_task
    from tdac_agent.runs.run_record import Run, load_run
    from tdac_agent.synthesis.synthesize import synthesize
    from tdac_agent.tasks.disturbance import Disturbance
    from tdac_agent.tasks.task import Task
    from tdac_agent.training.save_policy import save_policy
    from tdac_agent.verification.diagnosis.report import Report
    from tdac_agent.verification.verify import verify
    from tdac_agent.verification.verify_episodes import (
        verify_episodes,
        verify_on_set,
        verify_robust,
    )

__all__ = [
    "Disturbance",
    "Evaluation",
    "Policy",
    "Report",
    "Run",
    "RunHistory",
    "Task",
    "evaluate",
    "gather_run",
    "load_controller",
    "load_run",
    "load_task",
    "save_policy",
    "synthesize",
    "verify",
    "verify_episodes",
    "verify_on_set",
    "verify_robust",
]

_MODULE_OF = {
    "Disturbance": "tasks.disturbance",
    "Evaluation": "evaluation.evaluation_report",
    "Policy": "evaluation.policy",
    "Report": "verification.diagnosis.report",
    "Run": "runs.run_record",
    "Task": "tasks.task",
    "RunHistory": "runs.history",
    "evaluate": "evaluation.evaluate",
    "gather_run": "runs.history",
    "load_controller": "evaluation.policy",
    "load_run": "runs.run_record",
    "load_task": "runs.ownership",
    "save_policy": "training.save_policy",
    "synthesize": "synthesis.synthesize",
    "verify": "verification.verify",
    "verify_episodes": "verification.verify_episodes",
    "verify_on_set": "verification.verify_episodes",
    "verify_robust": "verification.verify_episodes",
}


def __getattr__(name: str) -> object:
    """Imports a public name on first use."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'tdac_agent' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"tdac_agent.{_MODULE_OF[name]}"), name)


def __dir__() -> list[str]:
    """All public names, imported yet or not."""
    return sorted({*globals(), *__all__})
