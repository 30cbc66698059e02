"""Where a page is: its folder, the pages above it, and itself."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from tdac_agent.studio.run_groups import campaign_of


class Step(NamedTuple):
    """A page above another one."""

    name: str
    address: str


NEW = Step("New controller", "/")
RUNS, BENCHES = Step("Runs", "/runs"), Step("Benches", "/benches")


def above_run(place: Path, at: str) -> list[Step]:
    """The pages above a run: the list of runs, and its campaign, if it has one."""
    campaign = campaign_of(place, at)
    if not campaign:
        return [RUNS]
    return [RUNS, Step(campaign, f"/campaign?at={quote(campaign)}")]


def trail_html(title: str, place: Path, under: Sequence[Step]) -> str:
    """The way to a page as a list.

    Args:
        title: What the page is about, a path below the last step if it begins with it.
        place: Folder of the studio.
        under: The pages above it.
    """
    last = title.removeprefix(f"{under[-1].name}/") if under else title
    steps = "".join(
        f'<li><a href="{escape(step.address)}">{escape(step.name)}</a></li>'
        for step in under
    )
    return (
        f'<ol><li title="{escape(str(place))}">{escape(place.name or str(place))}</li>'
        f'{steps}<li aria-current="page">{escape(last)}</li></ol>'
    )
