"""The commands `tdac doctor` and `tdac warm`."""

from __future__ import annotations

import typer

from tdac_agent.cli.shared_options import Json

app = typer.Typer()


@app.command(epilog="Example: `tdac doctor`")
def doctor(as_json: Json = False) -> int:
    """Check what works on this machine: sandbox, judge, video, extras.

    Exits with 3 if a required part does not work.
    """
    from tdac_agent.cli import doctor as command

    return command.run(as_json)


@app.command(epilog="Example: `tdac warm`")
def warm() -> int:
    """Compile everything now, so that no later command has to wait.

    If an administrator runs it on an installed package, it serves all users.
    """
    from tdac_agent.cli import warm as command

    return command.run()
