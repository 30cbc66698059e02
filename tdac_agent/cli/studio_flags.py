"""The command `tdac studio`."""

from __future__ import annotations

from typing import Annotated

import typer

from tdac_agent.cli.options import number_flag

app = typer.Typer()


@app.command(epilog="Example: `tdac studio --open`")
def studio(
    port: Annotated[
        int,
        number_flag(
            "--port",
            min=0,
            max=65535,
            help="Port; 0 for the one last used in this folder, or else any free one.",
        ),
    ] = 0,
    open_it: Annotated[
        bool, typer.Option("--open", help="Open the page in your browser.")
    ] = False,
) -> None:
    """Choose maps, watch candidates drive, and start runs, in the browser.

    The page shows the files and runs of the current folder. Only the browser that opens
    the printed address gets in.
    """
    from tdac_agent.cli import studio as command

    command.run(port, open_it)
