"""The choice of who writes the controller."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from nicegui import events, ui

from tdac_agent.models.prices import load_prices
from tdac_agent.models.tariff import MAX_COST
from tdac_agent.studio.folder import STATE
from tdac_agent.studio.pages.layout import keep_upload

WHO = {
    "builtin": "the built-in template, no language model",
    "anthropic": "a model of Anthropic",
    "openai": "a model of OpenAI, or of a server with its API",
    "manual": "a person, or a chat window: copy the prompt, paste the answer",
    "file": "a controller of my own; if it fails, the template takes over",
}
KEYS = {"anthropic": "ANTHROPIC_API_KEY", "openai": "OPENAI_API_KEY"}
QUESTIONS = "questions"
"""Folder in `.studio` with the questions of a `manual` run."""


class Writers:
    """The choice, as part of a page.

    Args:
        place: Folder of the studio.
        changed: Called after each change.
        on_task: Whether it is for a single task, which has two forms of a controller.
    """

    def __init__(
        self, place: Path, changed: Callable[[], None], *, on_task: bool = False
    ) -> None:
        self._place, self._changed, self._file = place, changed, ""
        self._on_task = on_task
        self._who = ui.radio(WHO, value="builtin", on_change=self._update).props(
            "dense"
        )
        with ui.row().classes("w-full items-end gap-4") as self._paid:
            self._model = ui.input("model", on_change=self._update).classes("w-56")
            self._server = ui.input(
                "server, if not the vendor's", on_change=self._update
            ).classes("w-64")
            self._most = ui.number(
                "cost limit, USD", value=MAX_COST, min=0, on_change=self._update
            ).classes("w-32")
        with ui.column().classes("w-full") as self._own:
            ui.upload(
                label="Drop controller.py here, or click", auto_upload=True,
                max_file_size=200_000, on_upload=self._uploaded,
            ).props("flat accept=.py")  # fmt: skip
        self._short = ui.checkbox(
            "ask only for policy(obs), not for all functions of the paper",
            on_change=self._update,
        ).props("dense")
        self._note = ui.label().classes("text-sm note")
        self._update()

    def words(self) -> list[str]:
        """The flags of the command line."""
        who = self._who.value
        if who == "file":
            return ["--from", self._file or "controller.py", "--profile", "policy"]
        if who == "builtin":
            return []
        short = self._on_task and self._short.value
        profile = ["--profile", "policy"] if short else []
        if who == "manual":
            return ["--learner", f"manual:{STATE}/{QUESTIONS}", *profile]
        words = ["--learner", f"{who}:{(self._model.value or '').strip()}", *profile]
        if self._server.value:
            words += ["--base-url", self._server.value.strip()]
        return [*words, "--max-cost", f"{self._most.value or 0:g}"]

    def with_folder(self, words: list[str], folder: str) -> list[str]:
        """The words, with a folder of questions that no other run has."""
        before, own = f"manual:{STATE}/{QUESTIONS}", f"manual:{folder}-{QUESTIONS}"
        return [own if word == before else word for word in words]

    def problem(self) -> str | None:
        """What is missing for a start; None if nothing is."""
        who = self._who.value
        if who == "file" and not self._file:
            return "Add your controller first."
        if who in KEYS:
            if not (self._model.value or "").strip():
                return "Enter the name of the model."
            if not self._server.value and not os.environ.get(KEYS[who]):
                return (
                    f"The key is missing: set {KEYS[who]} where you start the studio. "
                    "Keys are read from environment variables only."
                )
        return None

    def _update(self) -> None:
        who = self._who.value
        self._paid.visible, self._own.visible = who in KEYS, who == "file"
        self._short.visible = self._on_task and who in {*KEYS, "manual"}
        self._note.text = self.problem() or self._about()
        self._changed_if_ready()

    def _changed_if_ready(self) -> None:
        # While the page is being built, the command is not there yet.
        if hasattr(self, "_built"):
            self._changed()
        self._built = True

    def _about(self) -> str:
        """The given file, or the price of the chosen model, as far as it is known."""
        who = self._who.value
        if who == "file":
            return f"The controller is {Path(self._file).name}."
        if who not in KEYS:
            return ""
        name = f"{who}:{self._model.value.strip()}"
        price = load_prices().price_of(name, self._server.value or None)
        if price is None:
            return f"No price is known for {name}: the run may be refused."
        most = f"{self._most.value or 0:g}"
        return (
            f"{price.input:g} USD per million tokens in, {price.output:g} out; the run "
            f"stops before it has cost {most} USD."
        )

    async def _uploaded(self, event: events.UploadEventArguments) -> None:
        self._file = await keep_upload(event, self._place)
        self._update()
