"""The runs of a folder, by campaign."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from tdac_agent.campaign.drive import CONFIG_FILE
from tdac_agent.campaign.perform import RUNS
from tdac_agent.runs.run_record import DELIVERED
from tdac_agent.studio.folder import as_word, within

Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class RunGroup:
    """Runs that belong together.

    Attributes:
        campaign: Folder of their campaign, relative to that of the studio; empty for
            runs without one.
        rows: Their rows of the list of runs. Those of a campaign begin with the runs
            that are not verified; others have the newest first.
    """

    campaign: str
    rows: tuple[Row, ...]

    @property
    def verified(self) -> int:
        """Number of verified runs."""
        return sum(row["status"] == "verified" for row in self.rows)

    @property
    def usd(self) -> float | None:
        """What they cost, USD; None if that of one is unknown."""
        costs = [row["usd"] for row in self.rows]
        return None if None in costs else float(sum(costs))


def grouped(rows: Sequence[Row], campaigns: Sequence[str]) -> list[RunGroup]:
    """A group for each campaign, also without runs, then one for the other runs.

    Args:
        rows: Rows of the list of runs, the newest first.
        campaigns: Folders of campaigns, relative to that of the studio.
    """
    of: dict[str, list[Row]] = {campaign: [] for campaign in campaigns}
    others: list[Row] = []
    for row in rows:
        parents = map(str, PurePath(row["run"]).parents)
        own = next((at for at in parents if at in of), None)
        (others if own is None else of[own]).append(row)
    groups = [
        RunGroup(campaign, tuple(sorted(own, key=_needs_look)))
        for campaign, own in of.items()
    ]
    return [*groups, RunGroup("", tuple(others))]


def _needs_look(row: Row) -> tuple[bool, bool, str]:
    """Sorts runs as reports do: those that need a look first, by their names."""
    status = row["status"]
    return status == "verified", status in DELIVERED, row["run"]


def name_within(run: str, campaign: str) -> str:
    """A run's name in its campaign, `KIND/rNNNN`; its path if it has none."""
    if not campaign:
        return run
    return run.removeprefix(f"{campaign}/").removeprefix(f"{RUNS}/")


def campaign_command(at: str) -> str:
    """The command that begins a campaign of the folder, or goes on with it."""
    file = f"{as_word(at)}/{CONFIG_FILE}"
    return shlex.join(["tdac", "campaign", file, "--out", as_word(at)])


def campaign_of(place: Path, at: str) -> str:
    """The campaign of a run; empty if it has none.

    Args:
        place: Folder of the studio.
        at: The run, relative to it.
    """
    for parent in map(str, PurePath(at).parents):
        folder = within(place, parent)
        if parent != "." and folder is not None and (folder / CONFIG_FILE).is_file():
            return parent
    return ""
