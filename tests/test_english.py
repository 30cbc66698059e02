"""The counts that keep README and docs easy to read."""

import re

import pytest

from tools.english import MOST, PATTERNS, ROOT, _pages, blocks, long_blocks

PAGE = """# A heading that is not counted

A paragraph of
two lines with `code that is one word` and a [link](https://example.org/a/b).

- one item,
  which goes on
- another item
  1. a nested one

| head | second head |
|---|---|
| a cell | a longer cell |

```python
code = "is not counted"
```

:::{note}
Text of a directive.
:::

![A picture](picture.png)
"""


def test_the_blocks_of_a_page():
    """Each paragraph, item and cell is one, with its first line and without code."""
    found = [(line, text) for line, text in blocks(PAGE) if text.strip(" -|")]
    assert found == [
        (3, "A paragraph of two lines with code and a [link]."),
        (6, "one item, which goes on"),
        (8, "another item"),
        (9, "a nested one"),
        (11, "head"),
        (11, "second head"),
        (13, "a cell"),
        (13, "a longer cell"),
        (20, "Text of a directive."),
    ]


@pytest.mark.parametrize(
    ("words", "long"), [(120, False), (121, True)], ids=["120 words", "121 words"]
)
@pytest.mark.parametrize("form", ["{}", "- {}", "| cell | {} |"])
def test_more_than_120_words_are_too_many(form, words, long):
    """In a paragraph, an item or a cell."""
    text = form.format(" ".join(["word"] * words))
    assert bool(long_blocks(text)) is long


@pytest.mark.parametrize(
    ("name", "text", "count"),
    [
        ("that of", "Its axle is that of the robot, those of others differ.", 2),
        ("that of", "a state that often changes", 0),
        ("beside", "the file beside it, besides", 1),
        ("whoever", "Whoever has the salt knows the worlds.", 1),
        ("no … of", "The first ten are no choice of the author.", 1),
        ("none but", "It reads nothing at all but the file.", 1),
        ("none but", "Nothing is lost. But it is late.", 0),
        ("two semicolons", "one; two; three", 1),
        ("two semicolons", "one; two. three; four", 0),
        ("what is told", "It prints what was told.", 1),
    ],
)
def test_a_turn_of_phrase(name, text, count):
    """Each pattern finds its phrase and no other."""
    assert len(re.findall(PATTERNS[name], text, re.IGNORECASE)) == count


def test_all_pages_are_counted():
    """README, the docs and the guide for contributors are among them."""
    names = {path.relative_to(ROOT).as_posix() for path in _pages()}
    assert {"README.md", "CONTRIBUTING.md", "docs/first-steps.md"} <= names
    assert set(MOST) == set(PATTERNS)
