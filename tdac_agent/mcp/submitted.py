"""The source in what an agent submits."""

from __future__ import annotations

from tdac_agent.mcp.answers import Refused
from tdac_agent.prompting.extract import POLICY, read_answer
from tdac_agent.prompting.plain_answer import plain_text
from tdac_agent.prompting.python_source import left_out
from tdac_agent.sandbox import MAX_SOURCE_BYTES


def source_of(text: str) -> str:
    """The source in a submitted text.

    Raises:
        Refused: It is too large, empty, or not a whole file.
    """
    size = len(text.encode("utf-8", "surrogatepass"))
    if size > MAX_SOURCE_BYTES:
        raise Refused(
            f"the file has {size} bytes, and at most {MAX_SOURCE_BYTES} are allowed; "
            "it was not judged and does not count"
        )
    if not text.strip():
        raise Refused("the file is empty; it was not judged and does not count")
    source, problem = text, ""
    if plain_text(text).lstrip().startswith("```"):
        answer = read_answer(text, (POLICY,))
        source, problem = answer.source or "", answer.problem
    elif (gap := left_out(text, (POLICY,))) is not None:
        problem = f"the file leaves out code ({gap!r})"
    if problem:
        raise Refused(f"{problem}; it was not judged and does not count")
    return source
