"""Messages that Webots would print in its console."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any


def complain(text: str) -> None:
    """Prints to standard error."""
    print(text, file=sys.stderr)


_printed: set[str] = set()


def once(text: str) -> None:
    """Prints to standard error, each text only once."""
    if text not in _printed:
        _printed.add(text)
        complain(text)


def unsupported(call: str, result: Any = None) -> Callable[..., Any]:
    """A function that prints once that `call` is unsupported and returns `result`."""

    def absent(*_: Any, **__: Any) -> Any:
        once(f"tdac: {call}() is not supported; it has no effect")
        return result

    absent.__name__ = call.rpartition(".")[2]
    absent.__doc__ = f"Not supported; returns {result!r}."
    return absent
