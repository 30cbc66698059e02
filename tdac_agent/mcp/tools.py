"""The tools: their names, descriptions and schemas, and what each does."""

from __future__ import annotations

import base64
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mcp_types import CallToolResult, ImageContent, TextContent, Tool, ToolAnnotations
from pydantic import BaseModel, ConfigDict, Field

from tdac_agent.mcp.answers import (
    ChooseAnswer,
    SubmissionLine,
    SubmissionsAnswer,
    SubmitAnswer,
)
from tdac_agent.mcp.session import Session


class _Arguments(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Nothing(_Arguments):
    """No arguments."""


class Source(_Arguments):
    """Arguments of `submit`."""

    source: str = Field(
        description="The whole file `controller.py`, at most 200 kB of Python."
    )


class Numbered(_Arguments):
    """Arguments that name a submission."""

    submission: int = Field(description="Number of the submission, from `submit`.")


class FailuresOf(Numbered):
    """Arguments of `failures`."""

    envelope: int = Field(
        0,
        ge=0,
        le=512,
        description="On a task, for a submission that passed: also search, with at "
        "most so many episodes (16 or more; 128 take about a minute), for the smallest "
        "deviation with which it fails, such as another axle or a late action.",
    )


class PictureOf(Numbered):
    """Arguments of `picture`."""

    episode: int | str = Field(
        description="Name of the episode, as `submit` lists it: `nominal` or "
        "`jitter 1` on a task, the number of the world on a task set."
    )


@dataclass(frozen=True, slots=True)
class ToolSpec:
    """A tool.

    Attributes:
        name: Its name.
        description: What it does, for the agent.
        arguments: Its arguments.
        work: Does it; takes the session, the arguments, and the agent's program.
        answer: What its structured content is; None if it has none.
        reads: Whether it changes nothing.
    """

    name: str
    description: str
    arguments: type[_Arguments]
    work: Callable[[Session, Any, str], CallToolResult]
    answer: type[BaseModel] | None = None
    reads: bool = True

    def declared(self) -> Tool:
        """The tool, as clients list it."""
        answer = self.answer
        return Tool(
            name=self.name,
            description=self.description,
            input_schema=self.arguments.model_json_schema(),
            output_schema=None if answer is None else answer.model_json_schema(),
            annotations=ToolAnnotations(
                read_only_hint=self.reads,
                destructive_hint=self.name == "choose",
                idempotent_hint=self.reads or self.name == "choose",
                open_world_hint=False,
            ),
        )


def problem(text: str) -> CallToolResult:
    """The answer to a request that failed."""
    return CallToolResult(content=[_text(text)], is_error=True)


def _text(text: str) -> TextContent:
    return TextContent(type="text", text=text)


def _said(text: str, answer: BaseModel | None = None) -> CallToolResult:
    content = None if answer is None else answer.model_dump(mode="json")
    return CallToolResult(content=[_text(text)], structured_content=content)


def _read_task(session: Session, arguments: Nothing, client: str) -> CallToolResult:
    del arguments, client
    return _said(session.read_task())


def _submit(session: Session, arguments: Source, client: str) -> CallToolResult:
    answer = session.submit(arguments.source, client)
    number, left = answer.submission, session.left
    text = f"{'passed' if answer.passed else 'failed'}: {answer.summary}."
    if answer.passed:
        text += f" choose({number}) lets it drive blind, and ends the run."
    elif left.episodes is not None:
        text = f"failed to be verified so far: {answer.summary}. Only choose verifies."
    text += f"\nThis is submission {number}; failures({number}) tells more.\n"
    return _said(f"{text}Left: {left}.", answer)


def _state(line: SubmissionLine) -> str:
    """The state of a submission in one word or two."""
    return "verified" if line.verified else "passed" if line.passed else "not verified"


def _failures(session: Session, arguments: FailuresOf, client: str) -> CallToolResult:
    del client
    return _said(session.failures(arguments.submission, arguments.envelope))


def _picture(session: Session, arguments: PictureOf, client: str) -> CallToolResult:
    del client
    png = session.picture(arguments.submission, str(arguments.episode))
    data = base64.b64encode(png).decode("ascii")
    caption = (
        f"Submission {arguments.submission}, episode {arguments.episode}: the robot's "
        "path on the true map or world, with start, goal and, dashed, the shortest path"
    )
    image = ImageContent(type="image", data=data, mime_type="image/png")
    return CallToolResult(content=[image, _text(caption)])


def _submissions(session: Session, arguments: Nothing, client: str) -> CallToolResult:
    del arguments, client
    answer = session.listed()
    lines = [
        f"{each.submission}: {_state(each)}: {each.summary}"
        for each in answer.submissions
    ]
    lines = lines or ["nothing has been submitted"]
    lines.append(f"left: {session.left}" if answer.ended is None else answer.ended)
    return _said("\n".join(lines), answer)


def _choose(session: Session, arguments: Numbered, client: str) -> CallToolResult:
    del client
    answer = session.choose(arguments.submission)
    word = "verified" if answer.verified else "failed"
    return _said(f"{word}: {answer.summary}. The run has ended.", answer)


TOOLS = (
    ToolSpec(
        "read_task",
        "Read first: what the controller must do, what it observes, which functions it "
        "must define, how submissions are judged, and what is left of the budget.",
        Nothing,
        _read_task,
    ),
    ToolSpec(
        "submit",
        "Submit a controller, a whole Python file. It is judged in a sandbox, which "
        "takes from seconds to minutes. The answer's text begins with `passed` or "
        "`failed`. On a task set it drives on new worlds of `dev`, within the budget "
        "of episodes. Only `choose` verifies.",
        Source,
        _submit,
        SubmitAnswer,
        reads=False,
    ),
    ToolSpec(
        "failures",
        "What went wrong in a submission: failed tests, causes with their counts, and "
        "diagnoses of episodes. With `envelope`, also the smallest deviation with "
        "which it fails.",
        FailuresOf,
        _failures,
    ),
    ToolSpec(
        "picture",
        "A picture (PNG) of an episode of a submission: the map or world with the path "
        "that the robot drove. Episodes of held-out starts and of hidden worlds are "
        "not shown.",
        PictureOf,
        _picture,
    ),
    ToolSpec(
        "submissions",
        "All submissions with their results, what is left of the budget, and whether "
        "the run has ended.",
        Nothing,
        _submissions,
        SubmissionsAnswer,
    ),
    ToolSpec(
        "choose",
        "Choose a submission as the result and end the run; this cannot be undone, and "
        "nothing can be submitted afterwards. On a task, it must be one that passed; "
        "it drives blind, from about a hundred disturbed starts. On a task set, it "
        "drives on hidden worlds that are drawn now, at most 400, which may take many "
        "minutes. The answer is the verdict. If your client gives up "
        "waiting, call it again with the same number.",
        Numbered,
        _choose,
        ChooseAnswer,
        reads=False,
    ),
)
BY_NAME = {tool.name: tool for tool in TOOLS}
