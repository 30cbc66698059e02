"""Prints the size of each package, long modules, and the circles of the imports.

    python -m tools.sizes

A logical line is a statement as Python's tokenizer counts it; docstrings, comments and
blank lines do not count. A circle is a group of modules that import each other, also
through others; imports within functions and for types alone count, too. Exit 1 if a
limit below is exceeded.
"""

from __future__ import annotations

import ast
import io
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import grimp
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).parents[1]
PACKAGES = ("tdac_envs", "tdac_agent")
OTHERS = ("tests", "benchmarks", "tools")
CONTROLLERS = ("tdac_agent/builtin/levels/", "tdac_agent/planners/files/")
"""Folders of controllers, which are single files by contract; so is `sensors.py`."""
DATA = ("tests/agent/zoo/*/attacks/*", "tests/agent/webots/controllers/*")
"""Controllers that tests give to the judge; some of them are no Python."""
SINGLE_FILES = (*CONTROLLERS, "tdac_envs/controller_kit/sensors.py")
LONGEST, MOST_CIRCLES, LARGEST_CIRCLE = 350, 5, 6
"""Limits: lines of a module without docstrings, circles, modules of a circle."""


def main() -> int:
    """Returns 1 if a limit is exceeded."""
    sources = {path: (ROOT / path).read_text("utf-8") for path in _tracked()}
    lines = {path: logical_lines(text) for path, text in sources.items()}
    totals: Counter[str] = Counter()
    for path, count in lines.items():
        top, *inner = path.split("/")
        totals[top] += count
        if top in PACKAGES and len(inner) > 1:
            totals[f"{top}/{inner[0]}"] += count
    print("logical lines:")
    for name, count in sorted(totals.items()):
        print(f"{count:8,}  {'  ' if '/' in name else ''}{name}")
    print(f"{sum(totals[each] for each in PACKAGES):8,}  product")
    too_long = [
        f"{path}: {count} lines without docstrings"
        for path, text in sources.items()
        if path.startswith(PACKAGES) and not path.startswith(SINGLE_FILES)
        if (count := code_lines(text)) > LONGEST
    ]
    circles = import_circles()
    print(f"\ncircles of imports: {len(circles)}")
    for circle in circles:
        print(f"{len(circle):4}  {', '.join(circle)}")
    faults = [f"more than {LONGEST} lines: {each}" for each in too_long]
    if len(circles) > MOST_CIRCLES:
        faults.append(f"{len(circles)} circles of imports, at most {MOST_CIRCLES}")
    if circles and len(circles[0]) > LARGEST_CIRCLE:
        faults.append(f"a circle of {len(circles[0])}, at most {LARGEST_CIRCLE}")
    for fault in faults:
        print(f"too much: {fault}", file=sys.stderr)
    return 1 if faults else 0


def logical_lines(source: str) -> int:
    """The number of logical lines of a module, without docstrings."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    ends = sum(token.type == tokenize.NEWLINE for token in tokens)
    return ends - sum(1 for _ in _docstrings(source))


def code_lines(source: str) -> int:
    """The number of lines of a module, without docstrings."""
    inside = sum((end or start) - start + 1 for start, end in _docstrings(source))
    return source.count("\n") - inside


def import_circles() -> list[list[str]]:
    """Groups of modules that import each other, the largest first."""
    graph = grimp.build_graph(*PACKAGES, exclude_type_checking_imports=False)
    names = sorted(graph.modules)
    number = {name: n for n, name in enumerate(names)}
    arrows = [
        (number[name], number[other])
        for name in names
        for other in graph.find_modules_directly_imported_by(name)
    ]
    rows, columns = np.array(arrows).T
    size = (len(names), len(names))
    matrix = coo_array((np.ones(len(rows)), (rows, columns)), shape=size)
    _, groups = connected_components(matrix, connection="strong")
    found: dict[int, list[str]] = {}
    for name, group in zip(names, groups, strict=True):
        found.setdefault(int(group), []).append(name)
    circles = [members for members in found.values() if len(members) > 1]
    return sorted(circles, key=len, reverse=True)


def _tracked() -> list[str]:
    """The Python files of the repository."""
    names = [f"{name}/*.py" for name in (*PACKAGES, *OTHERS)]
    command = ["git", "ls-files", "-z", "--", *names, *(f":!{each}" for each in DATA)]
    listed = subprocess.check_output(command, cwd=ROOT, text=True)
    return [path for path in listed.split("\0") if path]


def _docstrings(source: str) -> Iterator[tuple[int, int | None]]:
    """First and last line of each docstring, also of attributes."""
    for node in ast.walk(ast.parse(source)):
        body = getattr(node, "body", None)
        for inner in body if isinstance(body, list) else ():
            if (
                isinstance(inner, ast.Expr)
                and isinstance(inner.value, ast.Constant)
                and isinstance(inner.value.value, str)
            ):
                yield inner.lineno, inner.end_lineno


if __name__ == "__main__":
    sys.exit(main())
