"""Resuming a run on a task set from its folder."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.runs.ownership import called, is_own, wishes_of
from tdac_agent.runs.resume import settings_of
from tdac_agent.runs.run_record import Run
from tdac_agent.tasks.task_file import SET_FILE
from tdac_agent.tasks.trust import permit
from tdac_envs.ladder.task_sets import load_set


def resume_set_arguments(
    run: Run, given: Mapping[str, Any], *, trust: bool = False
) -> dict[str, Any]:
    """The arguments of `synthesize_on_set` that resume a run.

    Args:
        run: The run as recorded.
        given: Arguments that replace recorded ones; they need no permission.
        trust: Whether another installation's run has all permissions that it needs.

    Raises:
        NotTrustedError: Another installation's run needs a permission.
        RunError: The run had not begun.
        TaskError: Its task set cannot be read.
    """
    file = run.folder / SET_FILE
    if not file.is_file():
        raise RunError(
            f"the run in {run.folder} ended before its files were written: repeat its "
            f"command with --out {run.folder}"
        )
    flags = {name: value for name, value in given.items() if value is not None}
    if not is_own(run, None):
        permit(called(run), wishes_of(run, None, flags), trust=trust)
    return {
        **settings_of(run),
        "tasks": load_set(file),
        "episodes": run.episodes,
        "feedback_episodes": run.feedback_episodes,
        **flags,
    }
