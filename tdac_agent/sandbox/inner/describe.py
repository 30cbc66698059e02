"""Describe an exception of the controller, showing only lines of its own file."""

from __future__ import annotations

from collections import deque
from types import TracebackType

from .wire import MAX_NAME, MAX_TEXT, RemoteError, printable

FILE_NAME = "controller.py"
MAX_LINES = 12
MAX_LINE = 160


def describe(error: BaseException, source: str) -> RemoteError:
    """Return the type and message of `error`, and where the controller raised it."""
    try:
        first, left_out, last = _own_frames(error.__traceback__)
        if isinstance(error, SyntaxError) and error.filename == FILE_NAME:
            last.append((error.lineno or 0, "<module>"))
        lines = source.splitlines()
        texts = [_frame_text(*frame, lines) for frame in (*first, *last)]
        if left_out:
            texts.insert(len(first), f"  ... {left_out} more ...")
        line = (last or first or [(0, "")])[-1][0]
        return RemoteError(
            type_name(error),
            _message(error),
            printable("\n".join(texts), MAX_TEXT),
            max(line, 0),
        )
    except BaseException:
        return RemoteError(type_name(error), "", "", 0)


def type_name(value: object) -> str:
    """Return the name of the class of `value`, bypassing any metaclass."""
    name = str(type.__dict__["__name__"].__get__(type(value)))
    return printable(name.replace("\n", " "), MAX_NAME)


def _message(error: BaseException) -> str:
    try:
        message = error.msg if isinstance(error, SyntaxError) else str(error)
        return printable(message, MAX_TEXT)
    except BaseException:
        return "(its text cannot be read)"


def _own_frames(
    traceback: TracebackType | None,
) -> tuple[list[tuple[int, str]], int, deque[tuple[int, str]]]:
    """Return the controller's first frames, the number left out, and the last ones."""
    half = MAX_LINES // 2
    first: list[tuple[int, str]] = []
    last: deque[tuple[int, str]] = deque(maxlen=half)
    left_out = 0
    while traceback is not None:
        code = traceback.tb_frame.f_code
        if code.co_filename == FILE_NAME:
            left_out += len(last) == half
            kept = first if len(first) < half else last
            kept.append((traceback.tb_lineno, code.co_name))
        traceback = traceback.tb_next
    return first, left_out, last


def _frame_text(number: int, name: str, lines: list[str]) -> str:
    text = lines[number - 1].strip() if 0 < number <= len(lines) else ""
    return f"  line {number}, in {name[:MAX_LINE]}: {text[:MAX_LINE]}"
