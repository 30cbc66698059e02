"""Source code and diffs as HTML; markup in them is escaped."""

from __future__ import annotations

import itertools

from markupsafe import Markup, escape
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import PythonLexer

MOST_LINE = 400
MOST_SOURCE = 200_000
_KINDS = {"+": "ins", "-": "del", "@": "b"}


def highlighted(source: str) -> Markup:
    """Highlights Python source: a `<span>` per line and token; CSS numbers lines."""
    shown = source[:MOST_SOURCE]
    lexer = PythonLexer(stripnl=False, ensurenl=False)
    # Pygments closes each `<span>` at the end of its line.
    marked = highlight(shown, lexer, HtmlFormatter(nowrap=True))
    lines = [Markup('<span class="l">{}</span>').format(Markup(line)) for line in
             marked.rstrip("\n").split("\n")]  # fmt: skip
    more = len(source) - len(shown)
    if more:
        lines.append(Markup("<em>… {} more characters</em>").format(more))
    return Markup("\n").join(lines)


def shown_diff(diff: str, most: int) -> Markup:
    """Formats at most `most` lines of a unified diff, without the two file names.

    Added lines are in `<ins>`, removed lines in `<del>`.
    """
    lines = diff.splitlines()
    lines = lines[2:] if diff.startswith("---") else lines
    blocks = [
        _block(_KINDS.get(mark, "span"), list(group))
        for mark, group in itertools.groupby(lines[:most], key=lambda line: line[:1])
    ]
    more = len(lines) - most
    if more > 0:
        blocks.append(Markup("<em>… {} more lines</em>").format(more))
    return Markup().join(blocks)


def count_changes(diff: str) -> tuple[int, int]:
    """Numbers of lines that a unified diff adds and removes."""
    marks = [line[:1] for line in diff.splitlines()[2:]]
    return marks.count("+"), marks.count("-")


def is_new_file(diff: str) -> bool:
    """Whether a unified diff is that of a file without an earlier version."""
    return "\n@@ -0,0 " in diff[:80]


def is_rewritten(diff: str, source: str) -> bool:
    """Whether a change kept less than half of the file.

    Args:
        diff: Unified diff from the file before.
        source: The file after it.
    """
    added, removed = count_changes(diff)
    before = len(source.splitlines()) - added + removed
    return added > 0 and 2 * removed > before


def _block(tag: str, lines: list[str]) -> Markup:
    text = escape("\n".join(line[:MOST_LINE] for line in lines))
    return Markup("<{0}>{1}</{0}>").format(Markup(tag), text)
