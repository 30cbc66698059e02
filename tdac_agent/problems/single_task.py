"""A single task as a problem: its controllers pass a suite of tests."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.prompting.context import contract_of
from tdac_agent.prompting.prompt import (
    FULL,
    ONE_TASK,
    PromptTemplate,
    generate_prompt,
)
from tdac_agent.prompting.rules import RepairRule
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.setting import Setting
from tdac_agent.tasks.task import (
    Task,
    display_name,
    portable_task_file,
    read_task,
    write_workdir,
)
from tdac_agent.tasks.task_file import OWN_SUITE, TASK_FILE, Profile
from tdac_agent.tasks.trust import allowed, keep_suite
from tdac_agent.verification.verify import suite_sha256
from tdac_envs.core.errors import one_line_reason
from tdac_envs.core.intake import IMAGE_BYTES, TEXT_BYTES, parse_json, read_file
from tdac_envs.mapping.map_folder import png

PREVIEW_FILE = "preview.png"
"""Picture of the map or world as it was read."""


@dataclass(frozen=True, slots=True, eq=False)
class TaskProblem:
    """See `Problem`."""

    task: Task

    tasks = None
    scope = ONE_TASK
    file = TASK_FILE
    has_hidden = False

    @property
    def name(self) -> str:
        """See `Problem`."""
        return self.task.name

    @property
    def called(self) -> str:
        """See `Problem`."""
        return f"the task {display_name(self.task)}"

    @property
    def sha256(self) -> str:
        """See `Problem`."""
        return self.task.sha256()

    @property
    def dynamics(self) -> str:
        """See `Problem`."""
        return self.task.dynamics()

    @property
    def suite_sha256(self) -> str:
        """See `Problem`."""
        return suite_sha256(self.task)

    @property
    def suite(self) -> Path | None:
        """See `Problem`."""
        return self.task.suite

    @property
    def profile(self) -> Profile:
        """See `Problem`."""
        return self.task.spec.profile

    @property
    def contract(self) -> tuple[str, ...]:
        """See `Problem`."""
        return contract_of(self.task)

    @property
    def setting(self) -> Setting:
        """See `Problem`."""
        return self.task.setting

    @property
    def text(self) -> str:
        """See `Problem`."""
        return portable_task_file(self.task, own_suite=OWN_SUITE)

    def check(self, improve: int = 0) -> None:
        """See `Problem`."""
        if improve:
            self.task.disturbed_options(self.task.own_disturbance())

    def permitted(self, suite: Path | None) -> TaskProblem:
        """See `Problem`."""
        own = suite or self.suite
        return TaskProblem(replace(self.task, suite=own, trusted=True))

    def allowed(self, suite: Path | None, *, trust: bool) -> TaskProblem:
        """See `Problem`."""
        return TaskProblem(allowed(self.task, suite, trust=trust))

    def question(
        self, rules: tuple[RepairRule, ...] = (), template: PromptTemplate = FULL
    ) -> str:
        """See `Problem`."""
        return generate_prompt(self.task, rules, template)

    def write_files(self, folder: Path) -> None:
        """See `Problem`."""
        write_workdir(folder, self.task)

    def write_originals(self, folder: Path) -> None:
        """See `Problem`: a picture, the user's own tests, the map or world as given."""
        setting = self.task.setting
        write_atomic(folder / PREVIEW_FILE, png(setting.preview()))
        if self.suite is not None:
            keep_suite(self.suite, folder)
        if setting.original is not None:
            content = read_file(setting.original.file, IMAGE_BYTES)
            write_atomic(folder / setting.original.name, content)


def kept_task(folder: Path) -> TaskProblem:
    """The task of a run folder, with its original parameters.

    The folder has a copy of the map or world; `params.json` names the original file.
    Its own tests may not run.

    Raises:
        RunError: The parameters are damaged.
        TaskError: The task cannot be read.
    """
    task = read_task(folder)
    setting: Any = task.setting
    try:
        raw = read_file(folder / "params.json", TEXT_BYTES)
        params = setting.params.read(parse_json(raw))
    except (OSError, ValueError) as error:
        raise RunError(
            f"cannot resume {folder}: params.json: {one_line_reason(error)}"
        ) from error
    return TaskProblem(replace(task, setting=replace(setting, params=params)))
