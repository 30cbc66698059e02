"""Tables of results below a title."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table


def titled_table(title: str, gap: int = 1) -> Table:
    """A table without columns, below its title.

    Args:
        title: Plain text.
        gap: Spaces right of each column.
    """
    return Table(
        title=escape(title),
        title_justify="left",
        title_style="bold",
        box=SIMPLE_HEAD,
        padding=(0, gap, 0, 0),
        show_edge=False,
    )
