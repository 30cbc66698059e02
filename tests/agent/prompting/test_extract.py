"""Finding the controller in a model's answer: the whole file, or nothing."""

import ast
import itertools
import re
import warnings

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tdac_agent.prompting.extract import extract_source, read_answer
from tdac_agent.prompting.fences import fenced_blocks
from tdac_agent.prompting.plain_answer import plain_text, readings, without_thinking

FEW = settings(
    deadline=None,
    max_examples=200,
    suppress_health_check=[HealthCheck.too_slow],
)
MANY = settings(FEW, max_examples=10_000)

signs = st.sampled_from(["```", "```", "```", "~~~", "````", "~~~~~", "``", "`" * 40])
PLAIN = ("", "python", "py", " Python title=x.py", "{.python}", " \t")
OTHER = ("json", "text", "markdown", "md", "diff", "pyth`on", "ünïcode", "\0")
infos = st.sampled_from(PLAIN) | st.sampled_from(OTHER)
indents = st.sampled_from(["", "", "", " ", "    ", "\t", " \t ", "\u00a0"])
ends = st.sampled_from(["\n", "\n", "\n", "\r\n", "\r", "\n\n", "", "\x0c\n", "\u2028"])
fences = st.builds("".join, st.tuples(indents, signs, infos, ends))
LINES = ("x = 1\n", "    y = 2\n", "def f():\n    return 1\n", "if x:\n", "else:\n")
OPEN = ('"""\n', "'''", "z = [\n", "1,\n", "]\n", "(", ")", "@f\n", "try:\n", "'", "~")
ODD = (
    "# note\n",
    "\\\n",
    "\\",
    "x\ty\n",
    "\ufeff",
    "\ud800",
    "\0",
    "é = '\\d'\n",
    "  \n",
)
code = st.sampled_from(LINES) | st.sampled_from(OPEN) | st.sampled_from(ODD)
prose = st.sampled_from(["Some words.\n", "Here you are:\n\n", "- a list\n", "> q\n"])
replies = st.lists(
    fences | fences | code | prose | st.text(max_size=12), max_size=24
).map("".join)


def parses(source):
    try:
        with warnings.catch_warnings(action="ignore"):
            return bool(ast.parse(source).body)
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        return False


def blocks_of(reply):
    """Everything between a fence and a later one that closes it, line by line."""
    lines = reply.split("\n")
    bare = [line.strip(" \t") for line in lines]
    runs = [len(b) - len(b.lstrip(b[:1])) if b[:1] in ("`", "~") else 0 for b in bare]
    for first, last in itertools.combinations(range(len(lines)), 2):
        same = bare[first][:1] == bare[last][:1]
        if runs[first] >= 3 and same and runs[last] >= runs[first]:
            yield lines[first + 1 : last]


def is_quoted(source, lines):
    """Whether a source is just those lines, all without the same indentation."""
    got = source.split("\n")[:-1]
    if len(got) != len(lines):
        return False
    cuts = {
        line.removesuffix(kept)
        for kept, line in zip(got, lines, strict=True)
        if kept != line
    }
    return len(cuts) <= 1 and not "".join(cuts).strip(" \t")


def check_reply(reply):
    source = extract_source(reply)
    if source is not None:
        assert parses(source)
        shown = readings(without_thinking(plain_text(reply)))
        blocks = itertools.chain.from_iterable(map(blocks_of, shown))
        assert any(is_quoted(source, lines) for lines in blocks)


@FEW
@given(replies | st.text())
def test_any_text_gives_a_quotation_or_none(reply):
    """Whatever the answer, the result is None or parses and stands there, whole."""
    check_reply(reply)


@pytest.mark.slow
@MANY
@given(replies | st.text())
def test_many_texts_give_a_quotation_or_none(reply):
    """The same, often."""
    check_reply(reply)


FILES = [
    '"""Use it:\n\n```\nimport controller\n```\n\nor\n\n~~~\nrun\n~~~\n"""\n\nX = 1\n',
    'def policy(obs):\n    """So:\n\n    ```python\n    policy({})\n    ```\n    """\n'
    "    return 0.0, 0.0\n",
    "x = [\n    1,\n~~~\n2,\n]\n\n\ny = '\\d'  # é\n",
    "'''\n```\n'''\n\n\n\nif __name__ == '__main__':\n    print('```')\n",
    "try:\n    x = {\n        'a': (1,\n              2)}\nfinally:\n    pass\n",
]
LITTLE = (
    "x = 1\n",
    "# note\n",
    "\n",
    "  \n",
    "é = '\\d'\n",
    "def f():\n    return 1\n",
)
EXAMPLE = "z = 1\n"
BEFORE = [
    *("", "Here:\n\n", "Say `x` ```inline``` and\n", "```\nls -l x y\n```\n"),
    *("```json\n{}\n```\nSo\n", "```\n\n```\n", f"```python\n{EXAMPLE}```\n"),
]
# What would make a longer reading fail in one way or another.
AFTER = [
    *("", "\n", "Done.\n", "Try\n```bash\npython controller.py\n```\n", "```\n"),
    *('"""\n```text\na b\n```\n', ")]\n```text\n(\n```\n", "else:\n~~~\na b\n~~~\n"),
    *("    x\n```\na b\n```\n", ", 2\n```\na b\n```\n", "'\n```\n\\\n```\n"),
]


@st.composite
def whole_replies(draw):
    """A file in a fence, in an answer that has other fences around it."""
    parts = st.lists(st.sampled_from(FILES) | st.sampled_from(LITTLE), max_size=2)
    file = "".join([*draw(parts), draw(st.sampled_from(FILES)), *draw(parts)])
    before, after = draw(st.sampled_from(BEFORE)), draw(st.sampled_from(AFTER))
    fence = draw(st.sampled_from(["```", "~~~", "````"]))
    # A bare fence does not tell a file from what stands between two of its strings.
    plain = [] if "```python" in file or "'''" in file else [""]
    language = draw(st.sampled_from([*plain, "python", "py", " Python"]))
    indent = draw(st.sampled_from(["", "", "  ", "\t"]))
    opening = f"{indent}{fence}{language}\n"
    body = "".join(f"{indent}{line}\n" for line in file.split("\n")[:-1])
    closing = f"{indent}{fence}\n"
    return file, before, opening + body, closing, after


def check_whole(parts, draw_cut):
    file, before, block, closing, after = parts
    reply = before + block + closing + after
    assert extract_source(reply) == file
    assert extract_source(reply.replace("\n", "\r\n")) == file
    # Cut anywhere in the block, once its opening fence is there.
    start = len(before) + block.index("\n")
    cut = draw_cut(st.integers(start, len(before + block + closing.rstrip()) - 1))
    assert extract_source(reply[:cut]) in (None, EXAMPLE)


@FEW
@given(whole_replies(), st.data())
def test_a_whole_file_is_found_and_a_truncated_one_is_not(parts, data):
    """The file comes out as it went in; cut short, nothing of it is used."""
    check_whole(parts, data.draw)


@pytest.mark.slow
@MANY
@given(whole_replies(), st.data())
def test_many_whole_and_truncated_files(parts, data):
    """The same, often."""
    check_whole(parts, data.draw)


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


@pytest.fixture
def parsed(monkeypatch):
    """Lengths of the texts that Python's parser was given."""
    lengths = []
    parse = ast.parse

    def counting(source):
        lengths.append(len(source))
        return parse(source)

    monkeypatch.setattr("ast.parse", counting)
    return lengths


TILDES = "1,\n" * 50 + "~~~\n"
GARBLED = {
    "openings": "```python\nx = (\n",
    "bare fences": "```\nx y\n",
    "fences only": "```\n",
    "longer and longer": "".join("`" * n + "\n" for n in range(3, 80)),
    "shorter and shorter": "".join("`" * n + "\n" for n in range(80, 3, -1)),
    "wrappers": "````\n```md\n",
    "examples": "```python\nx = 1\n```\n",
    "an unclosed bracket": TILDES,
    "an unclosed string": "~~~\n'",
    "broken at the end": "~~~\n" + "x = 1\n" * 50 + "y = (\n",
    "spaces": " ",
    "a fence and spaces": "\n```" + " " * 1000,
    "backticks": "`",
    "empty lines": "\n",
    "brackets": "(",
    "signs": "-",
}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", GARBLED)
def test_the_work_grows_with_the_length(parsed, name):
    """Four times the garbage is parsed at most about four times as much.

    Beside parsing there is one pass over the lines. 200 kB of spaces after a fence, or
    of anything else here, would take minutes if a pattern tried all ways to match.
    """
    start = "~~~python\nx = [\n" if name.startswith("an ") else "```python\n"
    work = {}
    for size in (50_000, 200_000):
        parsed.clear()
        garbage = GARBLED[name] * (size // len(GARBLED[name]))
        source = extract_source(f"{start}{garbage}\n{start[:3]}\n")
        work[size] = sum(parsed)
        assert source is None or parses(source)
    assert work[200_000] <= 5 * work[50_000] + 1000
    assert work[200_000] <= 25 * 200_000


def test_a_broken_file_is_not_replaced_by_an_example():
    """What was meant to be the file is the answer, and is asked for again."""
    broken = "```python\ndef policy(obs):\n    return (0, 0\n\n\nX = 2\n```\n"
    assert extract_source(f"```python\nx = 1\n```\n{broken}") is None
    assert extract_source(f"```\nx = 1\n```\n{broken}") is None
    assert extract_source(f"{broken}Or:\n```python\nx = 1\n```\n") is None
    assert extract_source(f"{broken}```python\n" + "x = 1\n" * 9 + "```\n") is not None


def test_data_beside_the_file_is_not_the_file():
    """JSON and the like are valid Python, too, and may be longer."""
    data = "```json\n{\n" + '"x": 1,\n' * 20 + "}\n```\n"
    assert extract_source(data + "```python\nx = 1\n```\n") == "x = 1\n"
    assert extract_source(data + "```\nx = 1\n```\n") == "x = 1\n"
    assert extract_source(data) is None


@pytest.mark.parametrize("wrapper", ["```markdown", "````md", "````", "~~~~"])
@pytest.mark.parametrize("after", ["", "That is all.\n"])
def test_an_answer_in_a_fence_of_its_own(wrapper, after):
    """Some models put all that they say between fences."""
    outer = wrapper.rstrip("markdown")
    text = f"{wrapper}\nHere:\n\n```python\nx = 1\n```\nSo.\n{outer}\n{after}"
    assert extract_source(text) == "x = 1\n"
    assert extract_source(text.replace("So.\n", "Run\n```sh\na b\n```\n")) == "x = 1\n"


def test_one_closing_fence_too_many():
    """A stray fence after the file is let pass; one with text after it is a block."""
    whole = "```python\nx = 1\n```\n"
    assert extract_source(f"{whole}```\n\n") == "x = 1\n"
    assert extract_source(f"{whole}```python\n") is None
    assert extract_source(f"{whole}```\ndef policy(obs):\n") is None


def test_no_warnings_of_the_code():
    """What Python would say about a file's escapes is no matter of the extractor."""
    assert extract_source("```\nx = '\\d'\n```\n") == "x = '\\d'\n"


def test_strings_keep_their_spaces():
    """A line of spaces inside a string is part of the file."""
    code = '  x = """\n    \n   a\n b\n"""\n'
    got = extract_source(f"  ```\n{code}  ```\n")
    assert got == 'x = """\n  \n a\n b\n"""\n'


FILE = "def policy(obs):\n    return 0.0, 0.0\n\n\nX = 1\n"


def test_two_files_are_no_answer():
    """Of two whole files nobody says which is meant; the same one twice is one."""
    later = FILE.replace("0.0, 0.0", "0.5, 0.5 if X else 0.0")
    block = "```python\n{}```\n".format
    answer = read_answer(f"{block(FILE)}Wait, better:\n{block(later)}")
    assert answer.source is None
    assert "two blocks" in answer.problem
    assert read_answer(block(FILE) + block(FILE)).source == FILE
    part = "def policy(obs):\n    ...\n"
    whole = FILE + "Y = [1, 2, 3]\n" * 9
    assert read_answer(block(part) + block(whole)).source == whole


def test_the_larger_tree_is_the_file():
    """Lines of comment do not make a block the file."""
    talk = "# a line\n" * 50 + "x = 1\n"
    text = f"```python\n{talk}```\n```python\n{FILE}```\n"
    assert extract_source(text) == FILE


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "it is empty"),
        ("Sorry.", "it has no fenced block"),
        ("```json\n{}\n```", "no fenced block of Python"),
        ("```python\nx = 1\n", "its last fenced block has no end"),
        ("```python\nx = (\n```", r"'\(' was never closed \(line 1: 'x = \('\)"),
        ("```python\n# nothing\n```", "it contains no statement"),
        ("```python\nx = 1\n```", "no `def policy` at its top level"),
        ("```python\nclass policy: ...\n```", "no `def policy` at its top level"),
    ],
)
def test_what_is_wrong_is_said(text, problem):
    """An answer that cannot be used is asked for again with the reason."""
    answer = read_answer(text, ("policy",))
    assert answer.source is None
    assert re.search(problem, answer.problem)


@FEW
@given(replies | whole_replies().map(lambda parts: "".join(parts[1:])) | st.text())
def test_an_answer_is_a_file_or_a_problem(reply):
    """Never both, never neither."""
    for contract in ((), ("policy",), ("policy", "main")):
        answer = read_answer(reply, contract)
        assert (answer.source is None) == bool(answer.problem)
        assert "\n" not in answer.problem


@FEW
@given(replies | st.text())
@example("~~~\n```\n```\r\n~~~\n")
def test_fenced_blocks_stand_in_the_text(reply):
    """Every block is a quotation, and a bare one is found, too."""
    text = plain_text(reply)
    for block in fenced_blocks(text, frozenset({"", "python", "json"})):
        assert block in text
    assert fenced_blocks("a\n```json\n[]\n```\n", frozenset({"json"})) == ["[]"]
