"""What Webots would print in its console."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any


def complain(text: str) -> None:
    """Prints to the standard error."""
    print(text, file=sys.stderr)


_said: set[str] = set()


def once(text: str) -> None:
    """Prints to the standard error, if the same was not printed before."""
    if text not in _said:
        _said.add(text)
        complain(text)


def unsupported(call: str, result: Any = None) -> Callable[..., Any]:
    """A function for a call that means nothing here: says so once, gives `result`."""

    def absent(*_: Any, **__: Any) -> Any:
        once(f"tdac: {call}() is not supported here; it has no effect")
        return result

    absent.__name__ = call.rpartition(".")[2]
    absent.__doc__ = f"Not supported; returns {result!r}."
    return absent
