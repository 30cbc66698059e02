"""`tdac studio`: a page in the browser for everything that the command line does."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

from tdac_agent.cli.studio_flags import StudioOptions
from tdac_envs.core.errors import TaskError
from tdac_envs.core.extras import install_command


def run(options: StudioOptions) -> None:
    """Serves the studio for the current folder until it is interrupted."""
    if find_spec("nicegui") is None:
        raise TaskError(f"the studio needs an extra: {install_command('studio')}")
    from tdac_agent.studio.serve import serve

    def announce(address: str) -> None:
        print(address, flush=True)
        print(
            "whoever opens this address is let in; "
            "Ctrl-C ends the studio, not its runs",
            file=sys.stderr,
        )

    print("starting the studio …", file=sys.stderr, flush=True)
    try:
        serve(Path(), options.port, announce, open_it=options.open_it)
    except OSError as error:
        reason = f"{error.strerror}; give another one"
        raise TaskError(f"--port {options.port}: {reason}") from error
