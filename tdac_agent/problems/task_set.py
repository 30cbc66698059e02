"""A task set as a problem: one controller for all of its worlds."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tdac_agent.prompting.extract import POLICY
from tdac_agent.prompting.prompt import FULL, PromptTemplate
from tdac_agent.prompting.rules import RepairRule
from tdac_agent.prompting.set_prompt import check_generated, set_prompt
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.task_file import OWN_SUITE, SET_FILE, Profile
from tdac_agent.tasks.trust import keep_suite, permit, suite_wish
from tdac_agent.verification.judge.set_files import level_params
from tdac_agent.verification.verify import suite_folder, tests_sha256
from tdac_envs.ladder.task_sets import TaskSet, load_set


@dataclass(frozen=True, slots=True, eq=False)
class SetProblem:
    """See `Problem`.

    Attributes:
        tasks: The task set.
        suite: Folder of the user's own tests, or None.
        trusted: Whether these tests may run; they run outside the sandbox.
    """

    tasks: TaskSet
    suite: Path | None = None
    trusted: bool = True

    task = None
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
    def dynamics(self) -> str:
        """See `Problem`."""
        return self.tasks.dynamics

    @property
    def suite_sha256(self) -> str:
        """See `Problem`: of the user's own tests alone.

        Raises:
            NotTrustedError: They may not run.
        """
        own = self.allowed(None, trust=False).suite
        return "" if own is None else tests_sha256(suite_folder(own))

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
        """See `Problem`."""
        return replace(self, suite=suite or self.suite, trusted=True)

    def allowed(self, suite: Path | None, *, trust: bool) -> SetProblem:
        """See `Problem`."""
        if suite is None and self.suite is not None and not self.trusted:
            permit(self.suite.parent, [suite_wish(self.suite)], trust=trust)
        return self.permitted(suite)

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
        """See `Problem`: the user's own tests."""
        if self.suite is not None:
            keep_suite(self.suite, folder)


def kept_set(folder: Path) -> SetProblem:
    """The task set of a run folder; its own tests may not run.

    Raises:
        TaskError: The task set cannot be read.
    """
    suite = folder / OWN_SUITE
    own = suite if suite.is_dir() else None
    return SetProblem(load_set(folder / SET_FILE), own, trusted=own is None)
