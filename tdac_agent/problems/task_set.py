"""A task set as a problem: one controller for all of its worlds."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tdac_agent.prompting.extract import POLICY
from tdac_agent.prompting.prompt import FULL, PromptTemplate
from tdac_agent.prompting.rules import RepairRule
from tdac_agent.prompting.set_prompt import check_generated, set_prompt
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.task_file import SET_FILE, Profile
from tdac_agent.verification.judge.set_files import level_params
from tdac_envs.ladder.task_sets import TaskSet


@dataclass(frozen=True, slots=True, eq=False)
class SetProblem:
    """See `Problem`."""

    tasks: TaskSet

    task = None
    suite = None
    suite_sha256 = ""
    scope = "this task set"
    contract = (POLICY,)
    file = SET_FILE
    has_hidden = True

    @property
    def name(self) -> str:
        """See `Problem`."""
        return self.tasks.name

    @property
    def called(self) -> str:
        """See `Problem`."""
        return f"the task set {self.tasks.name}"

    @property
    def sha256(self) -> str:
        """See `Problem`."""
        return self.tasks.sha256

    @property
    def profile(self) -> Profile:
        """See `Problem`."""
        return "policy"

    @property
    def setting(self) -> TaskSet:
        """See `Problem`."""
        return self.tasks

    @property
    def text(self) -> str:
        """See `Problem`."""
        values: Any = self.tasks.file.model_dump(mode="json", by_alias=True)
        return json.dumps(values, indent=2) + "\n"  # JSON is YAML

    def check(self, improve: int = 0) -> None:
        """See `Problem`."""
        del improve
        check_generated(self.tasks)

    def permitted(self, suite: Path | None) -> SetProblem:
        """See `Problem`: there are no tests."""
        del suite
        return self

    def question(
        self, rules: tuple[RepairRule, ...] = (), template: PromptTemplate = FULL
    ) -> str:
        """See `Problem`."""
        return set_prompt(self.tasks, rules, template)

    def write_files(self, folder: Path) -> None:
        """See `Problem`: what differs between worlds is left out."""
        text = json.dumps(level_params(self.tasks.file), indent=2) + "\n"
        write_atomic(folder / "params.json", text)

    def write_originals(self, folder: Path) -> None:
        """See `Problem`: there is nothing else."""
