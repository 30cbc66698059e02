"""A controller file as a policy for `env.step(policy(obs))`."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.episode import as_wheels, wrong_action
from tdac_agent.sandbox import Child, start
from tdac_agent.tasks.task import Task, write_workdir
from tdac_agent.verification.verify import read_source
from tdac_envs.drive.env import Observation


class Policy:
    """A controller that runs in its sandbox and answers observations.

    Call `reset` at the start of each episode: it starts a fresh process. `close` ends
    the process, as does the end of a `with` block.

    Args:
        source: Bytes of `controller.py`.
        task: Task whose files are in its working folder.
        tier: Sandbox tier, or `auto`.
    """

    def __init__(self, source: bytes, task: Task, tier: str = "auto") -> None:
        self._source = source
        self._tier = tier
        self._folder = tempfile.TemporaryDirectory(prefix="tdac-policy-")
        self._child: Child | None = None
        write_workdir(Path(self._folder.name), task)

    def reset(self, observation: Observation) -> None:
        """Starts the controller afresh and gives it the first observation.

        Raises:
            ControllerFault: The controller cannot be imported, or its `reset` fails.
        """
        self._end()
        self._child = start(Path(self._folder.name), self._source, tier=self._tier)
        self._child.load()
        self._child.reset(observation)

    def __call__(self, observation: Observation) -> NDArray[np.float32]:
        """The action for an observation, shape (2,), float32.

        Raises:
            ControllerFault: The controller raises, hangs or ends its process.
            ValueError: The answer is not two finite numbers.
        """
        if self._child is None:
            self.reset(observation)
        assert self._child is not None
        answer = self._child.policy(observation)
        wheels = as_wheels(answer)
        if wheels is None:
            raise ValueError(wrong_action(answer))
        return wheels

    def close(self) -> None:
        """Ends the process and removes its folder."""
        self._end()
        self._folder.cleanup()

    def __enter__(self) -> Policy:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _end(self) -> None:
        if self._child is not None:
            self._child.close()
            self._child = None


def load_controller(path: str | Path, task: Task, *, tier: str = "auto") -> Policy:
    """Loads a controller file as a policy.

    Args:
        path: The file.
        task: Task whose files are in its working folder.
        tier: Sandbox tier, or `auto`.

    Raises:
        ControllerFileError: The file cannot be read.
    """
    return Policy(read_source(Path(path)), task, tier)
