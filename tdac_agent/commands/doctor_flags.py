"""The command `tdac doctor`."""

from __future__ import annotations

import typer

from tdac_agent.commands.options import Json

app = typer.Typer()


@app.command(epilog="Example: `tdac doctor`")
def doctor(as_json: Json = False) -> None:
    """Say what works on this machine: sandbox tiers, window, video, extras, keys."""
    from tdac_agent.commands import doctor as command

    raise typer.Exit(command.run(as_json))
