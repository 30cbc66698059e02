"""A controller's own functions and objects, called in its sandbox."""

from __future__ import annotations

from typing import Any

from tdac_agent.sandbox import Child, Handle


class Remote:
    """An object of the controller that lives in its process.

    Attributes:
        type_name: Name of its class.
    """

    def __init__(self, child: Child, handle: Handle) -> None:
        self._child = child
        self._handle = handle
        self.type_name = handle.type_name

    def __repr__(self) -> str:
        return f"<{self.type_name} of the controller>"

    def call(self, method: str, *args: Any, **kwargs: Any) -> Any:
        """Calls a method; values as for `Unit.call`."""
        target = (self._handle, method)
        return _wrap(self._child, self._child.call(target, _send(args), kwargs))


class Unit:
    """The top level of a controller that was imported in its sandbox."""

    def __init__(self, child: Child) -> None:
        self._child = child

    def get(self, name: str) -> Any:
        """Value of a top-level name."""
        return _wrap(self._child, self._child.get(name))

    def call(self, name: str, *args: Any, **kwargs: Any) -> Any:
        """Calls a top-level function or class.

        Exact Python types are kept; what is not data comes back as a `Remote`.

        Raises:
            ControllerFault: It raised, took too long or ended its process.
        """
        return _wrap(self._child, self._child.call(name, _send(args), kwargs))


def _send(args: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(a._handle if isinstance(a, Remote) else a for a in args)


def _wrap(child: Child, value: Any) -> Any:
    if isinstance(value, Handle):
        return Remote(child, value)
    if type(value) in (list, tuple):
        return type(value)(_wrap(child, item) for item in value)
    return value
