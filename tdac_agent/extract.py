"""The controller's source in a model's answer."""

from __future__ import annotations

import ast
import re
import textwrap

MAX_INNER_FENCES = 20
_FENCE = re.compile(r"^[ \t]*(`{3,}|~{3,})[ \t]*([^`\n]*)$", re.MULTILINE)


def extract_source(text: str) -> str | None:
    """The longest fenced block that is valid Python, or None.

    A closing fence stands alone on its line and is as long as the opening one at
    least; a fence inside a string of the file therefore does not cut it as long as
    the longer reading still parses.
    """
    text = text.replace("\r\n", "\n")
    best: str | None = None
    fences = list(_FENCE.finditer(text))
    for index, opening in enumerate(fences):
        for closing in fences[index + 1 : index + 2 + MAX_INNER_FENCES]:
            if closing[2].strip() or not closing[1].startswith(opening[1]):
                continue
            block = textwrap.dedent(text[opening.end() + 1 : closing.start()])
            if (best is None or len(block) > len(best)) and _parses(block):
                best = block
    return best


def _parses(block: str) -> bool:
    try:
        return bool(ast.parse(block).body)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False
