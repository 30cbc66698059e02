"""The controller's source in a model's answer."""

from __future__ import annotations

import ast
import re

_FENCE = re.compile(r"^(`{3,}|~{3,})[ \t]*([\w+-]*)[^\n]*$", re.MULTILINE)


def extract_source(text: str) -> str | None:
    """The longest fenced block that is valid Python, or None.

    A closing fence stands alone at the start of a line, as long as the opening one at
    least; a fence inside a string of the file therefore does not cut it as long as
    the longer reading still parses.
    """
    best: str | None = None
    fences = list(_FENCE.finditer(text))
    for index, opening in enumerate(fences):
        for closing in fences[index + 1 :]:
            if closing.group(2) or not closing.group(1).startswith(opening.group(1)):
                continue
            block = text[opening.end() + 1 : closing.start()]
            if _parses(block) and (best is None or len(block) > len(best)):
                best = block
    return best


def _parses(block: str) -> bool:
    try:
        return bool(ast.parse(block).body)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False
