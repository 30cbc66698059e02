"""Counts what makes README and docs hard to read: `python -m tools.english`.

A paragraph, a list item or a cell of a table has at most `LONGEST` words. Some turns of
phrase are correct and are read twice; how often each may still stand is in `MOST`,
which only ever falls. `--show NAME` prints where one stands. Exit 1 above a limit.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = "README.md", "CONTRIBUTING.md", "docs/*.md", "results/README.md"
LONGEST = 120
"""Words of a paragraph, a list item or a cell of a table."""
PATTERNS = {
    "that of": r"\b(?:that|those) of\b",
    "beside": r"\bbeside\b",
    "whoever": r"\bwhoever\b",
    "no … of": r"\bno (?:choice|place|part) of\b",
    "none but": r"\b(?:none|nobody|nothing|no one)\b[^.;:]{0,40}\bbut\b",
    "two semicolons": r"[^.;:!?|]+;[^.;:!?|]+;[^.;:!?|]+",
    "what is told": r"\bwhat (?:is|was) (?:told|said|found|given)\b",
}
MOST = dict.fromkeys(PATTERNS, 0)
"""How often each may stand in all pages together."""


def main() -> int:
    """Returns 1 if there is more than allowed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--show", choices=("long", *PATTERNS))
    chosen = parser.parse_args().show
    pages = {path: blocks(path.read_text("utf-8")) for path in _pages()}
    where = {name: list(_places(pages, name)) for name in PATTERNS}
    where["long"] = [
        f"{path.relative_to(ROOT)}:{line}: {len(text.split())} words: {text[:60]} …"
        for path in pages
        for line, text in long_blocks(path.read_text("utf-8"))
    ]
    for place in where.get(chosen, ()):
        print(place)
    counts = {name: len(places) for name, places in where.items()}
    allowed = {**MOST, "long": 0}
    for name, count in counts.items():
        print(f"{count:4} of at most {allowed[name]:4}  {name}")
    above = [name for name, count in counts.items() if count > allowed[name]]
    for name in above:
        print(f"too many: {name} (`python -m tools.english --show '{name}'`)")
    return 1 if above else 0


def _pages() -> list[Path]:
    return sorted(file for pattern in PAGES for file in ROOT.glob(pattern))


def _places(pages: dict[Path, list[tuple[int, str]]], name: str) -> Iterator[str]:
    pattern = re.compile(PATTERNS[name], re.IGNORECASE)
    for path, own in pages.items():
        for line, text in own:
            for match in pattern.finditer(text):
                near = text[max(0, match.start() - 40) : match.end() + 40]
                yield f"{path.relative_to(ROOT)}:{line}: … {near} …"


def blocks(text: str) -> list[tuple[int, str]]:
    """The paragraphs, list items and cells of a page in Markdown, without code.

    Returns:
        The first line of each, from 1, and its words in one line.
    """
    found: list[tuple[int, list[str]]] = []
    fence, fresh = "", True
    for number, line in enumerate(text.splitlines(), 1):
        bare = line.strip()
        mark = re.match(r"`{3,}|~{3,}|:{3,}", bare)
        if mark and (not fence or bare.startswith(fence)):
            fence, fresh = ("" if fence else mark[0]), True
            if mark[0].startswith(":"):  # a directive has text
                fence = ""
            continue
        if fence:
            continue
        if not bare or bare.startswith(("#", "<", "![")):
            fresh = True
            continue
        if bare.startswith("|"):
            found += [(number, [cell]) for cell in bare.strip("|").split("|")]
            fresh = True
            continue
        if fresh or re.match(r"(?:[-*+]|\d+\.)\s", bare):
            found.append((number, []))
            fresh = False
        found[-1][1].append(bare)
    return [(line, _plain(" ".join(parts))) for line, parts in found]


def long_blocks(text: str) -> list[tuple[int, str]]:
    """The `blocks` of a page that have more than `LONGEST` words."""
    return [block for block in blocks(text) if len(block[1].split()) > LONGEST]


def _plain(text: str) -> str:
    """Text without the mark of an item, inline code and the addresses of links."""
    text = re.sub(r"^(?:[-*+]|\d+\.)\s+", "", text)
    text = re.sub(r"`[^`]*`", "code", text)
    return re.sub(r"\]\([^)]*\)", "]", text).strip()


if __name__ == "__main__":
    sys.exit(main())
