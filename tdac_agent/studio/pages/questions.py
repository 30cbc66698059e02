"""The questions of a `manual` run, which a person answers on its page."""

from __future__ import annotations

from pathlib import Path

from nicegui import ui

from tdac_agent.runs.run_record import JOURNAL
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.journal import read_records
from tdac_agent.storage.plain import printable
from tdac_agent.studio.pages.layout import copied
from tdac_envs.core.errors import TdacError
from tdac_envs.core.intake import RECORD_BYTES, read_file

KINDS = {
    "generate": "a controller: one whole file in a ```python block",
    "edit": "a repaired controller, in the form that the prompt asks for",
    "improve": "an improved controller, in the form that the prompt asks for",
    "summarise": "rules for later candidates: a list in a ```json block",
}
"""What questions ask for."""


class Questions:
    """A part of the page of a run.

    Args:
        folder: Folder of the questions; see `models.manual`.
        run: Folder of the run.
    """

    def __init__(self, folder: Path, run: Path) -> None:
        self._folder, self._run = folder, run
        self._question: Path | None = None
        self._asked = ui.column().classes("w-full gap-1")

    def look(self, *, running: bool) -> None:
        """Shows the open question, if there is one, and a box for its answer."""
        open_ones = [
            path
            for path in sorted(self._folder.glob("*.prompt.md"))
            if not _answer_to(path).exists()
        ]
        question = open_ones[0] if open_ones and running else None
        if question == self._question:
            return
        self._question = question
        self._asked.clear()
        if question is None:
            return
        text = _text(question)
        with self._asked, ui.card().classes("w-full"):
            unused = _last_unused(self._run)
            if unused:
                ui.label(unused[:1].upper() + unused[1:]).classes("problem")
            what = asked_for(self._run, text)
            ui.label(f"The run waits for {what}. Copy the prompt to a model:")
            with ui.row().classes("items-center"):
                ui.button(
                    "Copy the prompt", icon="content_copy",
                    on_click=lambda: copied(text),
                )  # fmt: skip
                ui.label(f"{len(text):,} characters").classes("note")
            shown = ui.expansion("Show the prompt").classes("w-full")
            with shown, ui.element("pre").classes("output"):
                ui.label(text)
            box = ui.textarea("and paste its whole answer here").classes("w-full")

            def send() -> None:
                if (box.value or "").strip():
                    write_atomic(_answer_to(question), box.value)
                else:
                    ui.notify("the answer is empty", type="warning")

            ui.button("Use this answer", on_click=send)


def asked_for(folder: Path, question: str) -> str:
    """What a question asks for, by the name under which the run keeps it."""
    for path in folder.glob("iterations/*/*/*.prompt*.md"):
        if _text(path) == question:
            return KINDS.get(path.name.partition(".")[0], "an answer")
    return "an answer"


def _text(file: Path) -> str:
    """What a question says; empty if it cannot be read."""
    try:
        return printable(read_file(file, RECORD_BYTES).decode("utf-8", "replace"))
    except OSError:
        return ""


def _last_unused(folder: Path) -> str:
    """Why the newest answer cannot be used; empty if it can."""
    try:
        records = read_records(folder / JOURNAL)
    except (TdacError, OSError, ValueError):
        return ""
    answers = ("call.reply", "call.fault", "call.unused")
    last = next((r for r in reversed(records) if r.get("event") in answers), {})
    if last.get("event") != "call.unused":
        return ""
    count = f"answer {last.get('asked')} of at most {last.get('most')}"
    return f"{count} cannot be used: {last.get('problem')}."


def _answer_to(question: Path) -> Path:
    return question.with_name(question.name.replace(".prompt.md", ".reply.md"))
