"""What answers of real models and programs look like, and what is made of each."""

import html
import json
import re
import textwrap
from pathlib import Path

import pytest

from tdac_agent.models.decoding import decode_answer
from tdac_agent.prompting.extract import read_answer
from tdac_agent.prompting.fences import MAX_INNER_FENCES
from tdac_agent.prompting.python_source import left_out
from tdac_agent.prompting.rule_answer import parse_operations

CASES = Path(__file__).parents[4] / "shared/data/cases"
FILE = """import math


def turn(error):
    return max(-1.0, min(1.0, 2.0 * error))


def policy(obs):
    x, y, yaw = obs["pose"]
    gx, gy = obs["goal"]
    rate = turn(math.atan2(gy - y, gx - x) - yaw)
    return 0.6 - rate, 0.6 + rate
"""
LATER = FILE.replace("0.6", "0.9")
BLOCK = f"```python\n{FILE}```\n"
DRAFT = f"```python\n{LATER}```\n"
POLICY = FILE[FILE.index("def policy") :]
TESTS = (
    "```python\nfrom controller import policy\n"
    + "left, right = policy({'pose': (0.0, 0.0, 0.0), 'goal': (1.0, 0.0)})\n" * 20
    + "```\n"
)
BROKEN_TESTS = TESTS.replace("left, right", "left, right =")
PROMPTS = ">>> " + FILE.strip().replace("\n", "\n... ") + "\n"
NUMBERED = "".join(f"{n:2}  {line}\n" for n, line in enumerate(FILE.split("\n"), 1))
QUOTED = "".join(f"> {line}\n" for line in f"So:\n\n{BLOCK}".split("\n"))
DIFF = f"--- a/controller.py\n+++ b/controller.py\n@@ -8,4 +8,4 @@\n{POLICY[:40]}\n"
SEARCH = f"<<<<<<< SEARCH\n{POLICY}=======\n{POLICY}>>>>>>> REPLACE\n"
TOOL = json.dumps({"name": "write_file", "arguments": {"content": FILE}})
DOCUMENTED = f'"""Use it:\n\n```python\npolicy(obs)\n```\n"""\n{FILE}'
COLOURED = "\x1b[32m" + FILE.replace("return", "\x1b[1mreturn\x1b[0m") + "\x1b[0m"
HARMONY = f"<|channel|>analysis<|message|>{DRAFT}<|end|><|start|>assistant"
LONG_TALK = "So it goes.\n" * 40

USED = {
    "a longer test script after it": f"The file:\n\n{BLOCK}\nA check:\n\n{TESTS}",
    "a longer test script before it": f"{TESTS}{BLOCK}",
    "a longer test script that is broken": f"{BLOCK}\n{BROKEN_TESTS}",
    "a draft in thinking": f"<think>\n{DRAFT}\nToo fast.\n</think>\n\n{BLOCK}",
    "thinking in capitals": f"<THINKING>{DRAFT}</THINKING>\n{BLOCK}",
    "two thoughts": f"<think>\n{DRAFT}</think>\nHm.\n<think>a</think>\n{BLOCK}",
    "a lone end of thinking": f"First:\n{DRAFT}\nToo fast.\n</think>\n\n{BLOCK}",
    "thinking on one line with the answer": f"<think>hm</think>{BLOCK}",
    "a thought after it": f"{BLOCK}<think>\n{DRAFT}</think>\nDone.",
    "thinking of a terminal program": f"Thinking...\n{DRAFT}...done thinking.\n{BLOCK}",
    "thinking of a template": f"[THINK]{DRAFT}[/THINK]{BLOCK}",
    "channels": f"{HARMONY}<|channel|>final<|message|>{BLOCK}<|return|>",
    "the word in a sentence": f"I need no <think> section.\n{BLOCK}",
    "a tag behind the closing fence": BLOCK.rstrip() + "<end_code>\n",
    "words behind the closing fence": f"{BLOCK.rstrip()} This drives.\n",
    "the same, and a test script": f"{BLOCK.rstrip()}<end_code>\n{TESTS}",
    "the same, and a command": f"{BLOCK.rstrip()} Run:\n```sh\na b\n```\n",
    "an end-of-turn token": f"{BLOCK.rstrip()}<|im_end|>",
    "byte order mark": f"\ufeff{BLOCK}",
    "colours of a terminal": f"\x1b[1mSo:\x1b[0m\n\x1b[36m```python\n{COLOURED}```",
    "line ends of Windows": BLOCK.replace("\n", "\r\n"),
    "line ends of an old Mac": BLOCK.replace("\n", "\r"),
    "doubled opening": f"```python\n# controller.py\n{BLOCK}",
    "doubled opening, bare": f"```\n{BLOCK}```\n",
    "doubled opening, both closed": f"```python\n{BLOCK}```\n\nDone.\n",
    "tildes": f"~~~python\n{FILE}~~~\n",
    "four ticks": f"````python\n{FILE}````\n",
    "python3": f"```python3\n{FILE}```",
    "py": f"```py\n{FILE}```",
    "Python": f"```Python\n{FILE}```",
    "python 3.11": f"```python3.11\n{FILE}```",
    "braces": f"```{{.python .numberLines}}\n{FILE}```",
    "a title": f'```python title="controller.py"\n{FILE}```',
    "a file name as the language": f"```controller.py\n{FILE}```",
    "language and file name": f"```python:src/controller.py\n{FILE}```",
    "no language": f"```\n{FILE}```",
    "in a list item": "1. It:\n"
    + BLOCK.replace("\n", "\n   ").replace("```", "   ```"),
    "indented by a tab": "\t" + BLOCK.replace("\n", "\n\t"),
    "a quotation": QUOTED,
    "raw code": FILE,
    "raw code with a fence in a docstring": DOCUMENTED,
    "a fence in a docstring": f"```python\n{DOCUMENTED}```\n",
    "raw code, indented": textwrap.indent(FILE, "    "),
    "code tags": f"<code>\n{FILE}</code>\n",
    "code tags with words": f"The file:\n<code>\n{FILE}</code>\nDone.\n",
    "a page": f'<pre><code class="language-python">{html.escape(FILE)}</code></pre>',
    "code tags around a block": f"<code>\n{BLOCK}</code>\n",
    "escaped HTML": html.escape(BLOCK),
    "non-breaking spaces": BLOCK.replace("    ", "\u00a0   "),
    "thin spaces": BLOCK.replace("    ", "\u2003\u2003\u2003 "),
    "zero-width spaces": BLOCK.replace("def ", "def \u200b"),
    "typographic quotes": BLOCK.replace('"pose"', "“pose”").replace('"goal"', "”goal“"),
    "the same file twice": f"{BLOCK}\nOnce more:\n{BLOCK}",
    "the same program twice": BLOCK + BLOCK.replace("import math", "import math  # it"),
    "a part quoted": f"{BLOCK}\nThe core of it:\n```python\n{POLICY}```\n",
    "an explanation with pseudo code": (
        "```pseudocode\nif near: stop\n```\n```text\ndef policy(obs): ...\n```\n"
        + BLOCK
    ),
    "a sketch, then the file": f"```python\ndef policy(obs):\n    ...\n```\n{BLOCK}",
    "several languages": f"```cpp\nint policy();\n```\n```json\n{{}}\n```\n{BLOCK}",
    "a file name before the block": f"controller.py\n{BLOCK}",
    "a file name in the block": f"```python\ncontroller.py\n{FILE}```",
    "a table and headings": f"# Plan\n\n| a | b |\n|---|---|\n\n## File\n{BLOCK}",
    "a block in a folded section": f"<details>\n\n{BLOCK}\n</details>\n",
    "a long talk": LONG_TALK + BLOCK + LONG_TALK,
    "an answer in Markdown": f"```markdown\nHere:\n{BLOCK}```\n",
}
"""Answers of which `FILE` is the file."""

REFUSED = {
    "an apology": ("I am sorry, I cannot do that.", "it has no fenced block"),
    "nothing": ("", "it is empty"),
    "white space": (" \n\n", "it is empty"),
    "thinking without an end": (f"<think>\n{BLOCK}", "thinking has no end"),
    "thinking alone": (f"<think>{BLOCK}</think>\n", "nothing follows its thinking"),
    "truncated": (BLOCK[:-60], "its last fenced block has no end"),
    "truncated after thinking": (f"<think>a</think>\n{BLOCK[:-5]}", "has no end"),
    "truncated after a doubled opening": (f"```python\n{BLOCK[:-9]}", "has no end"),
    "a truncated second block": (f"{BLOCK}\n{DRAFT[:-9]}", "has no end"),
    "truncated code tags": (f"<code>\n{FILE}", "has no end"),
    "fence at the end of a line": (BLOCK.replace("rate\n```", "rate```"), "no end"),
    "truncated raw code": (FILE[:-12], "no fenced block, and its last line may be cut"),
    "raw code cut in a bracket": (FILE[: FILE.index(", 2.0")], "no fenced block"),
    "raw code without policy": ("import math\n", "it has no fenced block"),
    "two versions": (f"{DRAFT}Better:\n{BLOCK}", "two blocks that may be the file"),
    "two versions, one in a tilde block": (
        f"{DRAFT}Or:\n~~~python\n{FILE}~~~\n",
        "two blocks",
    ),
    "left out": (
        BLOCK.replace(
            "    return max(-1.0, min(1.0, 2.0 * error))", "    # ... unchanged"
        ),
        r"leaves out code \('# ... unchanged'\)",
    ),
    "left out at the top": (
        f"```python\n# ... existing code ...\n\n{POLICY}```",
        "leaves out code .*whole file",
    ),
    "left out, no dots": (
        f"```python\n# The rest of the file is unchanged.\n{POLICY}```",
        "leaves out code",
    ),
    "left out, an ellipsis": (f"```python\n...\n\n{POLICY}```", "leaves out code"),
    "a body left out": (BLOCK.replace("return max", "...  # max"), "leaves out code"),
    "raw code, left out": (f"# ... imports here ...\n{POLICY}", "leaves out code"),
    "a diff": (f"```diff\n{DIFF}```\n", "it is a change"),
    "a patch without a fence": (DIFF, "it is a change"),
    "search and replace": (f"```python\n{SEARCH}```\n", "it is a change"),
    "JSON": (json.dumps({"code": FILE}), "it is JSON"),
    "JSON in a block": (f"```json\n{json.dumps({'code': FILE})}\n```", "of Python"),
    "a tool call": (f"<tool_call>\n{TOOL}\n</tool_call>", "it calls a tool"),
    "another tool call": (
        f'<function_calls><invoke name="w">{FILE}</invoke></function_calls>',
        "it calls a tool",
    ),
    "line numbers": (f"```python\n{NUMBERED}```", r"not Python: .*\(line \d"),
    "prompts of Python": (f"```python\n{PROMPTS}```", r"line 1: '>>> import math'"),
    "pseudo code": ("```python\nif near then stop\n```", "line 1: 'if near then stop'"),
    "another language alone": (
        "```cpp\nint policy();\n```",
        "no fenced block of Python",
    ),
    "a block marked as text": (f"```text\n{FILE}```", "no fenced block of Python"),
    "a function of another name": (
        BLOCK.replace("policy", "control"),
        "no `def policy`",
    ),
    "a method": (
        "```python\nclass A:\n    def policy(self, obs):\n        return 0, 0\n```",
        "no `def policy` at its top level",
    ),
    "a broken file and a good sketch": (
        "```python\ndef policy(obs):\n    return 0, 0\n```\n"
        + BLOCK.replace("(-1", "((1"),
        "not Python: ",
    ),
    "unclosed, then another block": (BLOCK[:-4] + TESTS, "not Python: "),
}
"""Answers without a usable file, and what the model is told."""


@pytest.mark.parametrize("shape", USED)
def test_the_file_is_found(shape):
    """In whatever it stands, the file comes out as it went in."""
    answer = read_answer(USED[shape], ("policy",))
    assert answer.problem == ""
    expected = DOCUMENTED if "docstring" in shape else FILE
    assert answer.source.strip("\n") == expected.strip("\n")


@pytest.mark.parametrize("shape", REFUSED)
def test_the_reason_is_told(shape):
    """What is truncated, ambiguous or no file is never used; one line says why."""
    text, reason = REFUSED[shape]
    answer = read_answer(text, ("policy",))
    assert answer.source is None
    assert re.search(reason, answer.problem)
    assert "\n" not in answer.problem


@pytest.mark.parametrize("shape", USED)
def test_no_cut_of_an_answer_is_used(shape):
    """An answer that is cut inside its only fenced block gives nothing."""
    text = USED[shape]
    if text.count("def policy") > 1 or "```" not in text or "docstring" in shape:
        return
    for cut in range(text.index("policy"), text.index("0.6 + ")):
        assert read_answer(text[:cut], ("policy",)).source is None


def test_the_block_that_meets_the_contract_is_the_file():
    """Not a longer block that lacks a name, even if it defines `policy`."""
    main = "\n\ndef main():\n    pass\n"
    longer = FILE.replace("0.6", "0.7") + "X = [1, 2, 3]\n" * 30
    text = f"```python\n{longer}```\n```python\n{FILE}{main}```\n"
    assert read_answer(text, ("policy", "main")).source == FILE + main
    # The tests say what is missing if there is no such block.
    assert read_answer(BLOCK, ("policy", "main")).source == FILE
    # Nothing marks the end of raw code, so there it must be complete.
    assert read_answer(FILE + main, ("policy", "main")).source == FILE + main
    assert read_answer(FILE, ("policy", "main")).source is None
    # Its last line has an end, or the server says that the answer has.
    assert read_answer(FILE.strip(), ("policy",)).source is None
    assert read_answer(FILE.strip(), ("policy",), ended=True).source == FILE


def test_an_exhausted_search_for_fences_is_no_file():
    """More fences in a docstring than are tried give a reason, not half a file."""
    inner = "```\nx\n```\n" * MAX_INNER_FENCES
    answer = read_answer(f'```python\n"""{inner}"""\n{FILE}```\n', ("policy",))
    assert answer.source is None
    assert answer.problem


@pytest.mark.parametrize("fence", ["```\n", f"{BLOCK.strip()}<end>\n", "> ```\n"])
def test_too_many_fences_are_no_file(fence):
    """Their pairs are not even tried."""
    answer = read_answer(fence * 2001, ("policy",))
    assert re.search(r"has \d+ fences, more than 2000", answer.problem)


COMMENTS = {
    "# ... (rest of the code unchanged) ...": True,
    "    # … existing functions …": True,
    "# [rest of the code]": True,
    "# other helpers remain the same": True,
    "# code omitted for brevity": True,
    "    pass  # unchanged": True,
    "# keep the rest of the path": False,
    "# Same as above, for the right wheel": False,
    "# so we slow down ... then turn": False,
    "# ranges[..., 0]: the rest are farther": False,
    "# the previous heading": False,
}


@pytest.mark.parametrize("comment", COMMENTS)
def test_placeholders_are_recognised(comment):
    """A comment that stands for code is one; a comment about the code is none."""
    assert (left_out(f"x = 1\n{comment}\ny = 2\n") is not None) == COMMENTS[comment]


GAPS = {
    "# existing code": False,
    "# Rest of the function": False,
    "if x:\n    pass  # unchanged": False,
    '"""Text:\n# ... rest of the code unchanged\n"""': False,
    "# ... unchanged ...": True,
    "# ... unchanged ...\r": True,
    "# rest of the code is unchanged": True,
    "def f():\n    pass  # unchanged": True,
    "def f():\n    # existing code\n    pass": True,
    "if x: ...": True,
    "for x in y:\n    z = 1\nelse: ...": True,
    "try: f()\nexcept ValueError: ...": True,
    "match x:\n    case 1: ...": True,
    "async def f(): ...": True,
    "class A:\n    async def f(self): ...": True,
    "class A(Protocol):\n    def f(self): ...": False,
    "@overload\ndef f(x): ...": False,
    "x[..., 0] = y": False,
}


@pytest.mark.parametrize("text", GAPS)
def test_gaps_in_a_file_with_a_policy(text):
    """What could be a heading is one there; a gap is found in any body."""
    assert (left_out(f"{text}\n{FILE}", ("policy",)) is not None) == GAPS[text]


@pytest.mark.parametrize(
    "piece",
    ["</code>", "</code> ", "<pre>", "# " + "." * 197 + "\n", "&lt;&#1" + "1" * 9999],
)
def test_a_long_answer_that_repeats_itself(piece):
    """It is read in a time that grows with its length, and without an error."""
    text = piece * (200_000 // len(piece))
    assert read_answer(f"{text}\n{BLOCK}", ("policy",)).source.strip() == FILE.strip()
    assert read_answer(text, ("policy",)).problem
    assert left_out(text) is None


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32"]
)
def test_answers_in_other_encodings(encoding):
    """The byte order mark names the encoding; UTF-16 is recognised without one."""
    assert decode_answer(BLOCK.encode(encoding)).removeprefix("\ufeff") == BLOCK
    assert decode_answer(b"\xff") == "\N{REPLACEMENT CHARACTER}"
    assert decode_answer(b"") == ""


def test_rules_after_thinking():
    """An answer with rules is freed of the same wrappings."""
    rules = '[{"op": "add", "text": "Stop before turning.", "scope": "task"}]'
    text = f"<think>\n```json\n[]\n```\n</think>\n```json\n{rules}\n```<end>\n"
    (operation,) = parse_operations(f"\ufeff{text}")
    assert operation.text == "Stop before turning."


@pytest.mark.parametrize(
    "case", sorted(path.name for path in CASES.glob("reply-*.md")) or ["none"]
)
def test_replies_that_were_once_unusable(case):
    """The block that defines `policy` is the file."""
    if case == "none":
        pytest.skip("there is no folder with cases")
    answer = read_answer(decode_answer((CASES / case).read_bytes()), ("policy",))
    assert answer.problem == ""
    assert "return 0.6 - rate, 0.6 + rate" in answer.source
