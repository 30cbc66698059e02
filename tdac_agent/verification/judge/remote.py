"""Calls of a controller's own functions and objects, in its sandbox."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from tdac_agent.sandbox import (
    Child,
    ChildUsage,
    ControllerError,
    ControllerFault,
    ControllerTimeout,
    Handle,
)


class Remote:
    """An object of the controller that lives in its process.

    Attributes:
        type_name: Name of its class.
    """

    def __init__(self, unit: Unit, handle: Handle) -> None:
        self._unit = unit
        self._handle = handle
        self.type_name = handle.type_name

    def __repr__(self) -> str:
        return f"<{self.type_name} of the controller>"

    def call(self, method: str, *args: Any, **kwargs: Any) -> Any:
        """Calls a method; values as for `Unit.call`."""
        return self._unit.send((self._handle, method), args, kwargs)

    def call_each(self, method: str, calls: list[tuple[Any, ...]]) -> list[Any]:
        """Calls a method many times; all calls share the time limit of one."""
        target = (self._handle, method)
        return list(
            self._unit._ask(
                lambda seconds: self._unit._child.call_each(target, calls, seconds)
            )
        )


class Unit:
    """The top level of a controller that was imported in its sandbox.

    Args:
        child: Child with the controller imported.
        deadline: Latest end of the last call, by `time.monotonic`.
        errors_as_faults: Context of each request; turns the judge's own errors into
            faults.

    Attributes:
        fault: Why the process can no longer be used; None while it answers.
    """

    def __init__(
        self,
        child: Child,
        deadline: float,
        errors_as_faults: Callable[[], AbstractContextManager[None]],
    ) -> None:
        self._child = child
        self._deadline = deadline
        self._errors_as_faults = errors_as_faults
        self.fault: ControllerFault | None = None

    def get(self, name: str) -> Any:
        """Value of a top-level name."""
        return self._ask(lambda seconds: self._child.get(name, timeout=seconds))

    def call(self, name: str, *args: Any, **kwargs: Any) -> Any:
        """Calls a top-level function or class.

        Exact Python types are kept; a result that is not data becomes a `Remote`.

        Raises:
            ControllerFault: The call raised, took too long or ended its process.
        """
        return self.send(name, args, kwargs)

    def send(
        self,
        target: str | tuple[Handle, str],
        args: tuple[Any, ...],
        kwargs: dict[str, Any],
    ) -> Any:
        """Calls a function by name, or a method of an object."""
        values = tuple(a._handle if isinstance(a, Remote) else a for a in args)
        return self._ask(
            lambda seconds: self._child.call(target, values, kwargs, seconds)
        )

    def close(self) -> ChildUsage:
        """Ends the process."""
        return self._child.close()

    def _ask(self, request: Callable[[float], Any]) -> Any:
        left = self._deadline - time.monotonic()
        seconds = min(self._child.limits.call_seconds, left)
        try:
            if seconds <= 0:
                raise ControllerTimeout("the verification", 0)
            with self._errors_as_faults():
                answer = request(seconds)
            return self._wrap(answer)
        except ControllerError:
            raise
        except ControllerFault as fault:
            self.fault = fault
            raise

    def _wrap(self, value: Any) -> Any:
        if isinstance(value, Handle):
            return Remote(self, value)
        if type(value) in (list, tuple):
            return type(value)(self._wrap(item) for item in value)
        return value
