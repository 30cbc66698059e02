"""The judge's side of one child: each request returns a value or raises a fault."""

from __future__ import annotations

import math
import time
import weakref
from collections.abc import Callable
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

from tdac_agent.sandbox.conversation import Conversation
from tdac_agent.sandbox.ending import ChildUsage, ProcessEnd
from tdac_agent.sandbox.errors import ControllerError, EnvRefusalError
from tdac_agent.sandbox.inner.wire import Handle, Kind, is_name
from tdac_agent.sandbox.limits import MAX_SOURCE_BYTES, Limits
from tdac_agent.sandbox.time_limit import TimeLimit
from tdac_agent.sandbox.waiting import RunQueue, usage_of_tree
from tdac_agent.sandbox.zygote import Forked


class EpisodeEnv(Protocol):
    """The judge's side of the environment that `run_episode` steps."""

    def reset(self) -> tuple[Any, dict[str, Any]]:
        """Return the first observation and info."""

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Return observation, reward, terminated, truncated and info.

        Raises:
            EnvRefusalError: The controller sees a RuntimeError with this message.
        """


class ProgramWorld(Protocol):
    """The judge's side of the world that a whole program steps."""

    @property
    def is_over(self) -> bool:
        """Whether the world has ended, so that the program should end too."""

    def reset(self) -> Any:
        """Return the data that the program gets when it starts."""

    def step(self, action: Any) -> Any:
        """Return the answer to a request; raises like `EpisodeEnv.step`."""


Answering = EpisodeEnv | ProgramWorld
Target = str | Handle | tuple[Handle, str]
"""A function by its name, a callable object, or an object and its method."""


class Child:
    """One sandboxed process with numpy loaded, for one controller and one use.

    A context manager; `close` kills the child. Methods that run the controller can
    raise a `ControllerFault`. Unless it is a `ControllerError`, the child has ended,
    and each further request raises the same fault again.

    Attributes:
        tier: Name of its sandbox tier.
        limits: Its resource limits.
        folder: Its private folder.
        pid: Process ID of the leader of its process group.
        controller_pid: ID of the process that runs the controller: the leader, or in
            the tier `namespaces` the inner process that the leader waits for.

    Args:
        tier: Name of its sandbox tier.
        limits: Its resource limits.
        forked: Its process, folder and channel.
    """

    def __init__(self, tier: str, limits: Limits, forked: Forked) -> None:
        self.tier = tier
        self.limits = limits
        self.folder = forked.folder
        self.pid = forked.pid
        self.controller_pid = forked.pid
        self._line = forked.line
        end, root = ProcessEnd(forked), forked.folder.root
        ends = forked.channel, forked.line, forked.lifeline
        self._talk = Conversation(*ends, limits, root, end)
        weakref.finalize(self, end)

    def __enter__(self) -> Child:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def waited(self) -> float:
        """Return its run-queue wait time, s; 0 if it is not known."""
        return self._line.waited()

    def cpu_seconds(self) -> float:
        """Return its user and system time so far, s; in steps of 10 ms."""
        return usage_of_tree(self.pid)[0]

    def close(self) -> ChildUsage:
        """Kill the child with all its processes; return its resource usage."""
        return self._talk.stop()

    def set_up(self, setup: dict[str, Any]) -> dict[str, bool]:
        """Have the child confine itself; return which promises hold."""
        seconds = self.limits.start_seconds
        facts = dict(self._talk.request(Kind.SETUP, setup, "start", seconds))
        self.controller_pid = self._line.pid = facts.pop("pid", self.pid)
        return facts

    def copy_files(
        self,
        workdir: Path | None,
        controller_source: str | bytes,
        weights: bytes | None = None,
    ) -> None:
        """Copy a working folder and a controller into a child that has none yet.

        Args:
            workdir: Folder whose files the controller may read, without subfolders.
            controller_source: Text of `controller.py`.
            weights: Content of `weights.npz`, which it may read, too.

        Raises:
            ControllerError: The source is larger than 200 kB.
            SandboxError: The folder cannot be copied.
        """
        if isinstance(controller_source, str):
            controller_source = controller_source.encode("utf-8", "surrogatepass")
        if len(controller_source) > MAX_SOURCE_BYTES:
            text = f"{len(controller_source)} bytes (limit {MAX_SOURCE_BYTES})"
            raise ControllerError("SourceTooLarge", text, 0, "", "import")
        self.folder.copy_files(workdir, controller_source, weights)

    def load(self, timeout: float | None = None) -> dict[str, str]:
        """Import the controller; return the type name of each public name."""
        seconds = timeout or self.limits.import_seconds
        names = self._talk.request(Kind.LOAD, None, "import", seconds)
        if type(names) is not dict or not all(map(is_name, chain(*names.items()))):
            self._talk.breach("expected the controller's names", "import")
        return names

    def get(
        self, name: str, owner: Handle | None = None, timeout: float | None = None
    ) -> Any:
        """Return a value of the controller's module, or an attribute of an object."""
        seconds = timeout or self.limits.call_seconds
        return self._talk.request(Kind.GET, (owner, name), name, seconds)

    def call(
        self,
        target: Target,
        args: tuple[Any, ...] = (),
        kwargs: dict[str, Any] | None = None,
        timeout: float | None = None,
    ) -> Any:
        """Call a function by name, a callable handle, or (handle, method name).

        Arguments may contain handles; a result without an encoding becomes a handle.
        """
        return self._use(Kind.CALL, target, (args, kwargs or {}), timeout)

    def call_each(
        self,
        target: str | tuple[Handle, str],
        calls: list[tuple[Any, ...]],
        timeout: float | None = None,
    ) -> Any:
        """Call a function or method many times; return all results in one answer."""
        return self._use(Kind.CALL_EACH, target, (calls,), timeout)

    def _use(
        self, kind: Kind, target: Target, rest: tuple[Any, ...], timeout: float | None
    ) -> Any:
        owner, name = _split(target)
        seconds = timeout or self.limits.call_seconds
        return self._talk.request(kind, (owner, name, *rest), name or "call", seconds)

    def reset(self, observation: Any, timeout: float | None = None) -> Any:
        """Call `reset(obs)`, if the controller has it."""
        seconds = timeout or self.limits.reset_seconds
        return self._talk.request(Kind.RESET, observation, "reset", seconds)

    def policy(self, observation: Any, timeout: float | None = None) -> Any:
        """Return the result of `policy(obs)`, unchecked."""
        seconds = timeout or self.limits.call_seconds
        return self._talk.request(Kind.POLICY, observation, "policy", seconds)

    def run_episode(
        self,
        env: EpisodeEnv,
        max_steps: int,
        timeout: float,
        deadline: float = math.inf,
    ) -> Any:
        """Call `run_episode(env, max_steps)`; `env` makes every step in this process.

        Args:
            env: Answers the controller's requests.
            max_steps: Passed to the controller.
            timeout: Seconds that the controller may compute, and sleep, in total.
            deadline: Value of `time.monotonic` at which the call ends, whether the
                controller or `env` took the time.
        """
        return self._converse(
            Kind.RUN_EPISODE,
            max_steps,
            "run_episode",
            env,
            timeout,
            lambda: deadline - time.monotonic(),
        )

    def run_program(
        self,
        world: ProgramWorld,
        name: str,
        arguments: list[str],
        timeout: float,
        grace: float,
    ) -> Any:
        """Run the controller's file as a program that asks `world` for each step.

        Its folder must contain a package `controller`, which connects the two.

        Args:
            world: Answers the program's requests in this process.
            name: Name of the folder in which it runs.
            arguments: Command-line arguments.
            timeout: Seconds that the program may compute, and sleep, in total.
            grace: Seconds that it may take after the world has ended.
        """
        return self._converse(
            Kind.RUN_PROGRAM,
            (name, arguments),
            "the run",
            world,
            timeout,
            lambda: grace if world.is_over else math.inf,
        )

    def _converse(
        self,
        kind: Kind,
        value: Any,
        phase: str,
        env: Answering,
        timeout: float,
        max_left: Callable[[], float],
    ) -> Any:
        """Send a request, and answer the controller's own requests until it is done.

        Args:
            kind: Kind of the request.
            value: Payload of the request.
            phase: Name of the request in messages.
            env: Answers the controller's requests.
            timeout: Seconds that the controller may compute, and sleep, in total.
            max_left: Returns the current upper bound on the seconds left.
        """
        limit = TimeLimit(timeout, self._line.measure, RunQueue("thread-self").waited)
        left = max_left()
        reply: tuple[Kind, Any] = (kind, value)
        while True:
            limit.start(left)
            self._talk.send(*reply, phase, limit.left, timeout)
            asked, value = self._talk.receive(phase, limit.left, timeout)
            left -= limit.stop()
            if asked == Kind.VALUE:
                return value
            if asked not in {Kind.ENV_RESET, Kind.ENV_STEP}:
                self._talk.breach("an unexpected answer", phase)
            try:
                answer = env.reset() if asked == Kind.ENV_RESET else env.step(value)
                reply = (Kind.ENV_REPLY, answer)
            except EnvRefusalError as error:
                reply = (Kind.ENV_REFUSAL, str(error))
            except BaseException:
                self.close()
                raise
            left = min(left, max_left())


def _split(target: Target) -> tuple[Handle | None, str | None]:
    if isinstance(target, str):
        return None, target
    return (target, None) if isinstance(target, Handle) else target
