"""The part of `sensors.py` that a prompt shows."""

from __future__ import annotations

import ast
from collections.abc import Collection

FOR_PEOPLE = ("Graphics", "show")
"""Names in `sensors.py` that only draw; a signature and docstring are enough."""


def needed_part(source: str, without: Collection[str] = ()) -> str:
    """Returns the part of `sensors.py` that a controller may use, verbatim.

    Args:
        source: The file.
        without: Functions of no use for the task.
    """
    lines, kept = source.splitlines(), []
    module = ast.parse(source)
    for node in module.body:
        first, last = node.lineno, node.end_lineno
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            if node.name.startswith("_") or node.name in without:
                continue
            kept.append("\n")
            if node.name in FOR_PEOPLE:
                last = node.body[0].end_lineno
        elif isinstance(node, ast.Import | ast.ImportFrom):
            continue
        kept.append("\n".join(lines[first - 1 : last]))
        if getattr(node, "name", "") in FOR_PEOPLE:
            kept.append("    ...")
    return "\n".join(kept)
