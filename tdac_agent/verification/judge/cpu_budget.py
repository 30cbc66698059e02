"""The CPU budget of a controller on a task set."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tdac_agent.sandbox import Child, ControllerOverdrawn
from tdac_envs.drive.env import Observation

if TYPE_CHECKING:
    from tdac_envs.ladder.set_limits import CpuSpec

EVERY = 10
"""Steps between two looks at the CPU time; each takes about 0.1 ms."""


class Budgeted:
    """A driver: a child whose CPU time is limited.

    Args:
        child: The child, before its controller is loaded.
        budget: What it may use.
    """

    def __init__(self, child: Child, budget: CpuSpec) -> None:
        self._child, self._budget = child, budget
        self._steps, self._begin = 0, child.cpu_seconds()

    def load(self) -> None:
        """Imports the controller.

        Raises:
            ControllerFault: It cannot be imported, or takes too long.
        """
        self._child.load()
        self._check_start("import")

    def reset(self, observation: Observation) -> object:
        """Passes the first observation on.

        Raises:
            ControllerFault: The controller fails or takes too long.
        """
        answer = self._child.reset(observation)
        self._check_start("reset")
        self._begin = self._child.cpu_seconds()
        return answer

    def policy(self, observation: Observation) -> Any:
        """The controller's unchecked action.

        Raises:
            ControllerFault: The controller fails or takes too long.
        """
        answer = self._child.policy(observation)
        self._steps += 1
        if self._steps % EVERY == 0:
            used, allowed = self.used(), self._budget.of_steps(self._steps)
            if used > allowed:
                what = f"{self._steps} steps"
                raise ControllerOverdrawn("policy", used, allowed, what)
        return answer

    def waited(self) -> float:
        """Its run-queue wait time, s."""
        return self._child.waited()

    def used(self) -> float:
        """CPU time since the reset, s."""
        return self._child.cpu_seconds() - self._begin

    def _check_start(self, phase: str) -> None:
        used = self.used()
        if used > self._budget.start:
            what = "import and reset"
            raise ControllerOverdrawn(phase, used, self._budget.start, what)
