"""The whole page: one file that loads nothing and runs only its own script."""

from __future__ import annotations

import base64
import functools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from tdac_agent.errors import RunError
from tdac_agent.html_report.code import (
    count_changes,
    highlighted,
    is_new_file,
    is_rewritten,
    shown_diff,
)
from tdac_agent.html_report.names import candidate_name, short_test
from tdac_agent.html_report.overview import format_seconds, overview_of
from tdac_agent.html_report.scene import TaskPicture, scene_of
from tdac_agent.html_report.section import (
    grouped_failures,
    section_of,
)
from tdac_agent.html_report.status_style import STATUS_STYLE
from tdac_agent.html_report.terms import explain_terms
from tdac_agent.models.budget import format_usd
from tdac_agent.runs.history import RunHistory, gather_run, learner_named, run_folders
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.verification.diagnosis.gap import gap_figure, gap_text, too_close_text
from tdac_agent.verification.diagnosis.second_opinion import opinion_text
from tdac_agent.verification.verdict import not_covered

MOST_BYTES = 24 << 20
"""Limit for the details of all runs; further runs are only listed."""
MOST_TEXT = 2_000
# Control characters that hide or reorder text are replaced by visible symbols.
_HIDDEN = {
    code: f"⟨U+{code:04X}⟩"
    for code in (*range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x200E, 0x200F, 0x61C)
} | {code: chr(0x2400 + code) for code in range(32) if chr(code) not in "\t\n"}


@dataclass(frozen=True, slots=True)
class Page:
    """A report.

    Attributes:
        html: Content of the file.
        runs: Number of runs.
        verified: Number of verified runs.
        unreadable: A line for each folder that could not be read.
    """

    html: bytes
    runs: int
    verified: int
    unreadable: tuple[str, ...]


def make_page(place: Path) -> Page:
    """Makes the report on a run folder, or on all runs at or below a folder.

    Raises:
        RunError: No run can be read.
    """
    place = place.resolve()
    runs: list[tuple[str, RunHistory]] = []
    unreadable: list[str] = []
    for folder in run_folders(place):
        name = place.name if folder == place else str(folder.relative_to(place))
        try:
            runs.append((name, gather_run(folder)))
        except RunError as error:
            unreadable.append(str(error).replace(str(folder), name))
    if not runs:
        raise RunError(unreadable[0])
    # What needs a look comes first, each in the order of the names.
    runs.sort(key=lambda one: (one[1].run.verified, one[1].run.passed))
    details, scenes = _details(runs)
    histories = [one for _, one in runs]
    html = rendered(
        "page.html.j2",
        scenes,
        name=place.name,
        runs=runs,
        unreadable=unreadable,
        overview=overview_of(histories),
        details=details,
    )
    return Page(
        html,
        len(runs),
        sum(one.run.verified for one in histories),
        tuple(unreadable),
    )


def rendered(template: str, scenes: Mapping[str, TaskPicture], **values: Any) -> bytes:
    """A page with its style, its script, and the scenes of its players.

    Args:
        template: Name of its template.
        scenes: Scenes by their keys.
        values: Further values for the template.
    """
    script = _text("page.js")
    html = _environment().get_template(template).render(
        scenes={key: _for_player(scene) for key, scene in scenes.items()},
        style=Markup(STATUS_STYLE + _text("page.css")),
        script=Markup(script),
        script_hash=own_script(),
        **values,
    )  # fmt: skip
    return explain_terms(html).translate(_HIDDEN).encode("utf-8", "replace")


def _details(
    runs: list[tuple[str, RunHistory]],
) -> tuple[list[Markup], dict[str, TaskPicture]]:
    """Renders the sections of as many runs as fit, and their scenes."""
    template = _environment().get_template("run.html.j2")
    scenes: dict[str, TaskPicture] = {}
    details: list[Markup] = []
    size = 0
    for number, (name, history) in enumerate(runs, 1):
        scene = _scene(history, scenes)
        values = section_of(history, number, name, scene, len(runs))
        section = template.render(values)
        size += len(section)
        if details and size > MOST_BYTES:
            break
        details.append(Markup(section))
    return details, scenes


def _scene(
    history: RunHistory, scenes: dict[str, TaskPicture]
) -> tuple[str, TaskPicture] | None:
    """The scene of a run's task; runs of the same task share it."""
    if history.task is None:
        return None
    key = history.task.sha256()
    if key not in scenes:
        scenes[key] = scene_of(history.task)
    return key, scenes[key]


def _for_player(scene: TaskPicture) -> dict[str, Any]:
    return {
        "picture": scene.picture,
        "width": scene.width,
        "height": scene.height,
        "radius": round(scene.radius, 2),
    }


@functools.cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tdac_agent", "html_report/templates"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )
    environment.filters |= {
        "broken": grouped_failures,
        "called": candidate_name,
        "changes": count_changes,
        "diff": shown_diff,
        "duration": format_seconds,
        "gap_figure": gap_figure,
        "gap_text": gap_text,
        "opinion_text": opinion_text,
        "too_close_text": too_close_text,
        "learner": learner_named,
        "new_file": is_new_file,
        "not_covered": not_covered,
        "rewritten": is_rewritten,
        "python": highlighted,
        "shortened": shortened,
        "test": short_test,
        "usd": format_usd,
    }
    return environment


def shortened(text: str) -> str:
    """Cuts a text to a bounded length."""
    return text if len(text) <= MOST_TEXT else f"{text[:MOST_TEXT]} …"


def _text(name: str) -> str:
    # raw read: shipped
    return (Path(__file__).parent / "templates" / name).read_text(encoding="utf-8")


def own_script() -> str:
    """The hash by which a content security policy allows the script of all pages."""
    digest = bytes.fromhex(sha256_of(_text("page.js")))
    return f"sha256-{base64.b64encode(digest).decode()}"
