"""The runs of the folder as tables: a card for each campaign, then the other runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from urllib.parse import quote

from nicegui import ui

from tdac_agent.models.budget import format_usd
from tdac_agent.studio.pages.layout import ShownCommand, address_of, heading
from tdac_agent.studio.run_groups import RunGroup, campaign_command, name_within

COLUMNS = [
    {"name": name, "label": name, "field": name, "align": "left", "sortable": True}
    for name in ("run", "task", "writer", "status", "progress", "cost", "started")
]
EACH_PAGE = 25
NONE_BEGUN = "None of its runs has begun. To begin:"
WRAPPED = """
.runs tbody td { white-space: normal; overflow-wrap: break-word; }
.runs tbody td:nth-child(2) { min-width: 9rem; overflow-wrap: anywhere; }
.runs tbody td a { color: var(--link); }
.q-table__card { background: var(--paper); }
.campaign { width: 100%; gap: .3rem; padding: .8rem 1rem; background: var(--paper);
  border: 1px solid var(--line); border-radius: 8px; }
.campaign .q-table__card { background: none; }
.campaign .q-item { padding: 0; min-height: 2.2rem; }
.campaign .nicegui-expansion-content { padding: .3rem 0 0; }
"""
# On a narrow page each run is a card, so that no column is hidden.
_CARDS = """
.runs tbody tr { display: grid; grid-template-columns: 2.6rem 1fr 1fr; padding: .5rem;
  border-bottom: 1px solid var(--line); }
.runs thead { display: none; }
.runs tbody td { border: none; height: auto; padding: .15rem .3rem;
  white-space: normal; overflow-wrap: anywhere; }
.runs tbody td:nth-child(1) { grid-row: 1 / 5; }
.runs tbody td:nth-child(2) { grid-column: 2 / 4; font-weight: 600; }
.runs tbody td:nth-child(n+3)::before { position: static; display: block;
  background: none; font-size: .75rem; color: var(--soft); }
""" + "".join(
    f'.runs tbody td:nth-child({number})::before {{ content: "{column["label"]}"; }}\n'
    for number, column in enumerate(COLUMNS[1:], 3)
)
TABLE_STYLE = f"{WRAPPED} @media (max-width: 799px) {{ {_CARDS} }}"


class RunTables:
    """The tables of one opened page, among which two runs are chosen to compare."""

    def __init__(self) -> None:
        self._shown: list[tuple[str, bool]] = []
        self._tables: dict[str, ui.table] = {}
        self._cards: dict[str, CampaignCard] = {}
        with ui.row().classes("w-full items-end justify-between") as self._bar:
            self._search = ui.input("search", on_change=self._searched)
            self._search.props("dense clearable")
            self._button = ui.button(icon="compare_arrows", on_click=self._compare)
            self._button.props("outline no-caps")
        self._list = ui.column().classes("w-full gap-3")
        self._chosen()

    def show(self, groups: Sequence[RunGroup]) -> None:
        """Shows the present runs; what is folded out or chosen stays so."""
        shown = [(group.campaign, bool(group.rows)) for group in groups]
        if shown != self._shown:
            self._shown = shown
            self._build(groups)
        for group in groups:
            if group.campaign in self._cards:
                self._cards[group.campaign].tell(group)
            table, rows = self._tables.get(group.campaign), _table_rows(group)
            if table is not None and rows != table.rows:
                table.update_rows(rows, clear_selection=False)
        self._bar.visible = bool(self._tables)

    def _build(self, groups: Sequence[RunGroup]) -> None:
        self._list.clear()
        self._tables, self._cards = {}, {}
        alone = len(groups) == 1
        with self._list:
            for group in groups:
                if group.campaign and not group.rows:
                    _show_unbegun(group.campaign)
                elif group.campaign:
                    card = self._cards[group.campaign] = CampaignCard(group)
                    with card.runs:
                        self._add_table(group)
                elif group.rows:
                    if not alone:
                        heading("Runs without a campaign")
                    self._add_table(group)
        self._chosen()

    def _add_table(self, group: RunGroup) -> None:
        table = self._tables[group.campaign] = _table(_table_rows(group))
        table.on_select(self._chosen)
        self._search.bind_value_to(table, "filter")

    def _searched(self) -> None:
        """Folds out the campaigns, among whose runs is searched, too."""
        for card in self._cards.values():
            card.runs.value = bool(self._search.value)

    @property
    def _selected(self) -> list[str]:
        tables = self._tables.values()
        rows = [row for table in tables for row in table.selected]
        return [row["run"] for row in rows if row["address"]]

    def _chosen(self) -> None:
        ready = len(self._selected) == 2
        self._button.text = (
            "Compare them" if ready else "Select two runs to compare them"
        )
        self._button.set_enabled(ready)

    def _compare(self) -> None:
        one, other = map(quote, self._selected)
        ui.navigate.to(f"/compare?one={one}&other={other}")


class CampaignCard:
    """A campaign that has begun: what is verified, what it cost, and its runs, folded.

    Args:
        group: Its runs.

    Attributes:
        runs: The part to fold out.
    """

    def __init__(self, group: RunGroup) -> None:
        with ui.column().classes("campaign"):
            with ui.row().classes("w-full items-center gap-x-4 gap-y-1"):
                heading(group.campaign)
                self._verified = ui.label()
                self._cost = ui.label().classes("note text-sm")
                ui.space()
                report = ui.link("Report", address_of("/campaign", group.campaign))
                report.props["aria-label"] = f"Report on {group.campaign}"
            self.runs = ui.expansion("").classes("w-full").props("dense")
        self.tell(group)

    def tell(self, group: RunGroup) -> None:
        """Says how many runs are verified, and what all cost."""
        verified, count = group.verified, len(group.rows)
        colour = (
            "verified" if verified == count else "mixed" if verified else "not-verified"
        )
        self._verified.text = f"{verified} of {count} verified"
        self._verified.classes(replace=f"status {colour}")
        usd = group.usd
        self._cost.text = "cost not known" if usd is None else format_usd(usd)
        self.runs.text = f"{count} run{'' if count == 1 else 's'}"
        if 0 < verified < count:
            self.runs.text += ", those that are not verified first"


def _show_unbegun(campaign: str) -> None:
    """A campaign without runs, and the command that begins it."""
    with ui.column().classes("campaign"):
        heading(campaign)
        ui.label(NONE_BEGUN)
        ShownCommand().show(campaign_command(campaign))


def _table_rows(group: RunGroup) -> list[dict[str, Any]]:
    return [
        {**row, "name": name_within(row["run"], group.campaign)} for row in group.rows
    ]


def _table(rows: list[dict[str, Any]]) -> ui.table:
    table = ui.table(
        columns=COLUMNS,
        rows=rows,
        row_key="run",
        selection="multiple",
        pagination={"rowsPerPage": EACH_PAGE},
    ).classes("w-full runs")
    table.props("flat" if len(rows) > EACH_PAGE else "flat hide-bottom")
    table.add_slot(
        "body-cell-status",
        '<q-td :props="props"><span :class="`status ${props.value.replaceAll(\' \', '
        "'-')}`\">{{ props.value }}</span></q-td>",
    )
    table.add_slot(
        "body-cell-run",
        '<q-td :props="props"><a v-if="props.row.address" :href="props.row.address">'
        "{{ props.row.name }}</a><span v-else>{{ props.row.name }}</span></q-td>",
    )
    return table
