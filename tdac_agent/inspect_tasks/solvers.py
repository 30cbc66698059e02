"""Solvers of the Inspect tasks: repair after feedback, and tdac's own controllers."""

from __future__ import annotations

from inspect_ai.model import ChatMessageUser, ModelOutput
from inspect_ai.solver import Generate, Solver, TaskState, solver

from tdac_agent.inspect_tasks.names import registered
from tdac_agent.inspect_tasks.scoring import answer_of, in_thread
from tdac_agent.problems.problem import Judged, Poll
from tdac_agent.synthesis.answers import Exam, reference_of, unusable
from tdac_agent.synthesis.candidates import raw
from tdac_envs.core.arguments import whole_number

MOST_ATTEMPTS = 100
REPAIR = (
    "{feedback}\n\nFind the cause before you change anything. Then answer with the "
    "whole corrected file in one fenced ```python block."
)


@solver(name=registered("repair"))
def repair(attempts: int = 4) -> Solver:
    """Asks the model, and lets it repair a controller that fails.

    The feedback is that of `tdac synth`. On a level it comes from worlds of `dev`, new
    ones for each answer, never from the worlds that the scorer uses.

    Args:
        attempts: Most answers.
    """
    whole_number("attempts", attempts, 1, MOST_ATTEMPTS)

    async def solve(state: TaskState, generate: Generate) -> TaskState:
        state = await generate(state)
        for turn in range(attempts - 1):
            told = await _told(state, turn)
            if told is None or state.completed:
                break
            state.messages.append(ChatMessageUser(content=told))
            state = await generate(state)
        return state

    return solve


async def _told(state: TaskState, turn: int) -> str | None:
    """What to say about the last answer; None if nothing failed."""
    source, problem = answer_of(state)
    if source is None:
        return unusable(problem)

    def rehearse(exam: Exam, poll: Poll) -> Judged:
        return exam.rehearse(raw(source), turn, poll)

    judged = await in_thread(state, rehearse)
    return None if judged.passed else REPAIR.format(feedback=judged.feedback)


@solver(name=registered("tdac_builtin"))
def tdac_builtin() -> Solver:
    """Answers with tdac's own controller and asks no model, to try an installation."""

    async def solve(state: TaskState, generate: Generate) -> TaskState:  # noqa: ARG001
        source = await in_thread(state, lambda exam, _: reference_of(exam.problem))
        answer = f"```python\n{source}```\n"
        state.output = ModelOutput.from_content("tdac builtin", answer)
        state.messages.append(state.output.message)
        return state

    return solve
