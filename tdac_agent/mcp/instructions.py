"""What the tool `read_task` answers."""

from __future__ import annotations

from tdac_agent.mcp.answers import Left

_ON_TASK = """\
Each submission is tested by the task's test suite. `passed` means that all tests
passed; such a submission can be chosen. Only `choose` verifies: the submission drives
blind, from about a hundred other starts with noise and slip, of which one may fail."""
_ON_SET = """\
Each submission drives on the next few worlds of the split `dev`, none of which comes
twice. That is feedback, and no verdict: only `choose` verifies, by driving one
submission on hidden worlds that are drawn after the choice. Choose when you can do no
better."""
_HOW = """\
You are asked for a robot controller for {about}, one Python file.

1. Write the file as described below, and call `submit` with its whole text.
2. `failures` tells what went wrong, `picture` shows an episode. Repair, submit again.
3. Call `choose` with the best submission: it gives the verdict and ends the run.

{judged}

Left: {left}.

Where the text below asks for an answer with a fenced block, call `submit` instead. The
judge runs the file in a sandbox; only what it does in an episode counts.

---

{question}"""


def instructions(about: str, left: Left, question: str) -> str:
    """What is to be written, and how the server works.

    Args:
        about: What the controller is for.
        left: What is left of the budget.
        question: The prompt of the task or set.
    """
    judged = _ON_TASK if left.episodes is None else _ON_SET
    return _HOW.format(about=about, left=left, judged=judged, question=question)
