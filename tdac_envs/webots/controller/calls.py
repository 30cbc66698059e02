"""Class decorators that add the uniform calls of Webots' API to a class."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from .messages import unsupported

Class = TypeVar("Class")


class Decorator(Protocol):
    """Changes a class and returns it."""

    def __call__(self, cls: type[Class], /) -> type[Class]:
        """Returns the same class."""


def getters(*attributes: str, **calls: str) -> Decorator:
    """Adds a getter for each attribute: `getMaxRange()` for `max_range`.

    Args:
        attributes: Names of attributes, most of which are properties.
        calls: Attributes whose getter has another name: `getDef="DEF"`.
    """

    def getter(name: str) -> Callable[[Any], Any]:
        def get(device: Any) -> Any:
            return getattr(device, name)

        get.__doc__ = f"See `{name}`."
        return get

    usual = {f"get{name.title().replace('_', '')}": name for name in attributes}
    return _adding({call: getter(name) for call, name in (usual | calls).items()})


def constants(**results: Any) -> Decorator:
    """Adds getters that always return the same value."""

    def getter(result: Any) -> Callable[[Any], Any]:
        def get(_: Any) -> Any:
            return result

        get.__doc__ = f"Always {result!r}."
        return get

    return _adding({call: getter(result) for call, result in results.items()})


def lacking(**results: Any) -> Decorator:
    """Adds calls that are not supported, which return these values."""

    def add(cls: type[Class]) -> type[Class]:
        for call, result in results.items():
            setattr(cls, call, unsupported(f"{cls.__name__}.{call}", result))
        return cls

    return add


def _adding(calls: dict[str, Callable[[Any], Any]]) -> Decorator:
    def add(cls: type[Class]) -> type[Class]:
        for call, function in calls.items():
            function.__name__, function.__qualname__ = call, f"{cls.__name__}.{call}"
            setattr(cls, call, function)
        return cls

    return add
