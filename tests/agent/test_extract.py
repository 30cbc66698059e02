"""Finding the controller in a model's answer."""

import ast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tdac_agent.extract import extract_source

FENCES = ["```python\n", "```\n", "~~~\n", "````\n", "  ```py\n", "```", "\t```\n"]
CODE = ["x = 1\n", '"""\n', "def f():\n    return 1\n", "Some words.\n", "\r\n", "'"]
PIECES = st.lists(st.sampled_from(FENCES + CODE) | st.text(max_size=12), max_size=14)


@given(PIECES)
def test_any_text_gives_valid_source_or_none(pieces):
    """Whatever the answer, the result is None or parses and is not empty."""
    source = extract_source("".join(pieces))
    assert source is None or ast.parse(source).body


@pytest.mark.parametrize("fence", ["```", "~~~", "`````"])
@pytest.mark.parametrize("language", ["", "python", "py", " python title=x.py"])
@pytest.mark.parametrize("indent", ["", "  ", "    ", "\t"])
def test_a_fenced_block_is_found(fence, language, indent):
    """Backticks or tildes, with or without a language, also inside a list item."""
    lines = [f"{fence}{language}", "def policy(obs):", "    return 0, 0", fence]
    text = "Here:\n\n" + "\n".join(indent + line for line in lines) + "\nDone.\n"
    assert extract_source(text) == "def policy(obs):\n    return 0, 0\n"


def test_line_ends_of_windows():
    """CRLF is read as a line end, not as part of the code."""
    assert extract_source("a\r\n```python\r\nx = 1\r\ny = 2\r\n```\r\n") == (
        "x = 1\ny = 2\n"
    )


def test_a_fence_inside_a_docstring_does_not_cut_the_file():
    """The longer reading wins while it still parses."""
    code = '"""Use it so:\n\n```\nimport controller\n```\n"""\n\nX = 1\n'
    assert extract_source(f"```python\n{code}```\n") == code


def test_of_two_blocks_the_longest_counts():
    """Examples beside the file do not replace it, and prose is never code."""
    text = "```python\nx = 1\n```\nThen\n```python\nx = 1\ny = 2\n```\n```\nz\n```\n"
    assert extract_source(text) == "x = 1\ny = 2\n"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no code at all",
        "x = 1",
        "```python\nx = 1\n",
        "```python\nx = 1\n``",
        "~~~python\nx = 1\n```\n",
        "````python\nx = 1\n```\n",
        "```python\ndef f(:\n```\n",
        "```python\n```\n",
        "```python\n# only a comment\n```\n",
        "```python\nx = 1\0\n```\n",
    ],
)
def test_no_whole_block_is_no_code(text):
    """A truncated or broken answer gives nothing rather than half a file."""
    assert extract_source(text) is None


def test_many_fences_end_soon():
    """A garbled answer of thousands of fences takes no long time."""
    assert extract_source("```python\nx = (\n" * 3000) is None
    assert extract_source("```\nx y\n" * 3000) is None
