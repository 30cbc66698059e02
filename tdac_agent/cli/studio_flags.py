"""The command `tdac studio`."""

from __future__ import annotations

from dataclasses import dataclass

import typer

from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option

app = typer.Typer()


@dataclass(frozen=True, slots=True)
class StudioOptions:
    """The flags of `tdac studio`."""

    port: int = option(
        0,
        "Port; 0 for the one last used in this folder, or else any free one.",
        least=0,
        most=65535,
    )
    open_it: bool = option(False, "Open the page in your browser.", "--open")


@app.command(epilog="Example: `tdac studio --open`")
@typed_options("studio:run")
def studio(options: StudioOptions) -> None:
    """Choose maps, watch candidates drive, and start runs, in the browser.

    The page shows the files and runs of the current folder. Only the browser that opens
    the printed address gets in.
    """
