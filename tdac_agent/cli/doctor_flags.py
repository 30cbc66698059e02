"""The commands `tdac doctor` and `tdac warm`."""

from __future__ import annotations

import typer

from tdac_agent.cli.options import Json

app = typer.Typer()


@app.command(epilog="Example: `tdac doctor`")
def doctor(as_json: Json = False) -> None:
    """Try what works on this machine: sandbox, compiled code, judge, video, extras.

    Exits with 3 where something does not work that everything needs.
    """
    from tdac_agent.cli import doctor as command

    raise typer.Exit(command.run(as_json))


@app.command(epilog="Example: `tdac warm`")
def warm() -> None:
    """Compile everything now, so that no command has to wait for it later.

    Run by an administrator on an installed package, this is done for all users of the
    machine.
    """
    from tdac_agent.cli import warm as command

    raise typer.Exit(command.run())
