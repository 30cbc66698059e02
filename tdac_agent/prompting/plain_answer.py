"""Removal from a model's answer of what is not the answer: terminal codes, thinking.

Some programs and servers also disguise an answer, for example with HTML escapes. This
is undone only if the answer cannot be used as it is (`readings`).
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterator

BOM = "\ufeff"
# Colours, cursor movements and titles (ECMA-48).
_TERMINAL = re.compile(
    "\x1b(?:\\[[0-?]*[ -/]*[@-~]|\\][^\x07\x1b]*(?:\x07|\x1b\\\\)|[@-Z\\\\-_])"
)
_TAG = r"(?:think|thinking|thought|reasoning|scratchpad)"
# What begins and ends thinking, in several templates. An opening stands at the start
# of a line, so that a sentence about it is none. A lone end is common: some templates
# put the opening into the prompt.
_OPENING = re.compile(
    rf"^[ \t]*(?:<{_TAG}>|\[THINK\]|◁think▷|<\|channel\|>analysis<\|message\|>"
    r"|Thinking\.\.\.[ \t]*$)",
    re.IGNORECASE | re.MULTILINE,
)
_ENDING = re.compile(
    rf"</{_TAG}>|\[/THINK\]|◁/think▷|<\|channel\|>final<\|message\|>"
    r"|^[ \t]*\.\.\.done thinking\.[ \t]*$",
    re.IGNORECASE | re.MULTILINE,
)
_CODE_TAGS = re.compile(r"^[ \t]*(?:<(?:pre|code)\b[^<>\n]*>)+", re.I | re.MULTILINE)
# A match begins with the first of several tags, so that each is read once.
_CODE_ENDS = re.compile(
    r"(?<!</pre>)(?<!</code>)(?:</(?:pre|code)>)+[ \t]*$", re.I | re.MULTILINE
)
_ESCAPE = re.compile(r"&(?:lt|gt|amp|quot|apos|nbsp|#\d{1,7}|#x[0-9a-f]{1,6});", re.I)
_QUOTED = re.compile(r"^[ \t]*> ?", re.MULTILINE)
_SPACES = dict.fromkeys(map(ord, "\u00a0\u1680\u202f\u205f\u3000"), " ")
_SPACES |= dict.fromkeys(range(8192, 8203), " ")
_INVISIBLE = _SPACES | dict.fromkeys(map(ord, "\u00ad\u200b\u200c\u200d\u2060\ufeff"))
_QUOTES = {ord(sign): '"' for sign in "“”„‟«»"} | {ord(sign): "'" for sign in "‘’‚‛"}


def plain_text(answer: str) -> str:
    """Returns an answer without byte order mark and terminal codes, and with LF."""
    text = answer.lstrip(BOM)
    if "\x1b" in text:
        text = _TERMINAL.sub("", text)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def without_thinking(text: str) -> str | None:
    """Returns the text without thinking; None if its thinking has no end.

    Everything before a lone end is thinking, too.
    """
    kept: list[str] = []
    at, thinking = 0, False
    marks = [(m.start(), m.end(), True) for m in _OPENING.finditer(text)]
    marks += [(m.start(), m.end(), False) for m in _ENDING.finditer(text)]
    for start, end, opens in sorted(marks):
        if opens and not thinking:
            kept.append(text[at:start])
        elif not opens and not thinking:
            kept.clear()
        thinking, at = opens, end
    return None if thinking else "".join([*kept, text[at:]])


def readings(text: str) -> Iterator[str]:
    """Yields the text, and then the text with one more kind of disguise removed."""
    yield text
    for undo in (_untagged, _unescaped, _unquoted, _visible, _straight):
        before, text = text, undo(text)
        if text != before:
            yield text


def _untagged(text: str) -> str:
    """Turns `<code>` and `<pre>` into fences; removes them if there are fences."""
    fence = "" if "```" in text else "```"
    text = _CODE_TAGS.sub(f"{fence}\n", text)
    return _CODE_ENDS.sub(f"\n{fence}", text)


def _unescaped(text: str) -> str:
    try:
        return html.unescape(text) if _ESCAPE.search(text) else text
    except ValueError:  # a number with thousands of digits
        return text


def _unquoted(text: str) -> str:
    """Removes the `>` of a Markdown quotation that has a fence."""
    return _QUOTED.sub("", text) if re.search(r"^[ \t]*> ?```", text, re.M) else text


def _visible(text: str) -> str:
    """Replaces unusual spaces, and removes characters without width."""
    return text.translate(_INVISIBLE)


def _straight(text: str) -> str:
    """Replaces typographic quotation marks, as word processors write them."""
    return text.translate(_QUOTES)
