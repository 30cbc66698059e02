"""The choice of who writes the controller."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from nicegui import events, ui

from tdac_agent.errors import ProviderError
from tdac_agent.models.choice import Options, check_names, missing_for_name
from tdac_agent.models.prices import load_prices
from tdac_agent.models.ready import needs_limit
from tdac_agent.models.tariff import MAX_COST
from tdac_agent.models.vendors import VENDORS
from tdac_agent.studio.folder import STATE
from tdac_agent.studio.pages.layout import keep_upload

OTHERS = {
    "manual": "a person, or a chat window: copy the prompt, paste the answer",
    "file": "a controller of my own; if it fails, the template takes over",
}
QUESTIONS = "questions"
"""Folder in `.studio` with the questions of a `manual` run."""


def _who() -> dict[str, str]:
    """Who can write the controller, with what the page calls them."""
    vendors = {
        each.name: f"a model of {each.company}{each.serves}"
        for each in VENDORS.values()
    }
    return {"builtin": "the built-in template, no language model", **vendors, **OTHERS}


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
        self._who = ui.radio(_who(), value="builtin", on_change=self._update).props(
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
        words = ["--learner", self._learner, *profile]
        if self._base_url:
            words += ["--base-url", self._base_url]
        if self._most.visible:
            words += ["--max-cost", f"{self._most.value or 0:g}"]
        return words

    @property
    def _learner(self) -> str:
        return f"{self._who.value}:{(self._model.value or '').strip()}"

    @property
    def _base_url(self) -> str | None:
        return (self._server.value or "").strip() or None

    def with_folder(self, words: list[str], folder: str) -> list[str]:
        """The words, with a folder of questions that no other run has."""
        before, own = f"manual:{STATE}/{QUESTIONS}", f"manual:{folder}-{QUESTIONS}"
        return [own if word == before else word for word in words]

    def problem(self) -> str | None:
        """What is missing for a start; None if nothing is."""
        who = self._who.value
        if who == "file" and not self._file:
            return "Add your controller first."
        if who not in VENDORS:
            return None
        if self._learner == f"{who}:":
            return "Enter the name of the model."
        try:
            check_names([self._learner], self._base_url)
            missing = missing_for_name(self._learner, Options(None, self._base_url))
        except ProviderError as error:
            return str(error)
        text = "; ".join(missing)
        return f"{text} (where you start the studio)" if missing else None

    def _update(self) -> None:
        who = self._who.value
        self._paid.visible, self._own.visible = who in VENDORS, who == "file"
        self._short.visible = self._on_task and who in {*VENDORS, "manual"}
        problem = self.problem()
        known = who in VENDORS and problem is None
        self._most.visible = not known or needs_limit(self._learner, self._base_url)
        self._note.text = problem or self._about()
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
        if who not in VENDORS:
            return ""
        if not self._most.visible:
            return "A server on this machine: its answers are not counted in money."
        name = self._learner
        price = load_prices().price_of(name, self._base_url)
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
