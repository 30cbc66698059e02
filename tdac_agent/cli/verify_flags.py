"""The command `tdac verify`."""

from __future__ import annotations

import gc

import typer

from tdac_agent.cli.shared_options import NoiseFlags
from tdac_agent.cli.task_flags import ONLY_FOR_SYNTH, TaskFlags
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.cli.verify_options import VerifyOptions

app = typer.Typer()


@app.command(
    epilog="Examples: `tdac verify controller.py --task maze`; "
    "`tdac verify runs/maze-1`; `tdac verify runs/maze-1 --robust 200`; "
    "`tdac verify runs/maze-1 --start 90 302`; `tdac verify mine.py --set unknown`"
)
@typed_options(without=ONLY_FOR_SYNTH)
def verify(options: VerifyOptions, flags: TaskFlags, noise: NoiseFlags) -> int:
    """Test a controller in the sandbox; exit 0 only if it is verified.

    It must pass all tests, and then at most one of 93 blind drives may fail.

    With --set, it drives on worlds that it has never seen; exit 0 only if a sequential
    test accepts it.
    """
    # Imported objects live until exit: collecting them is a waste of time.
    gc.disable()
    from tdac_agent.verification.judge.child_pool import ChildPool

    # Its first process starts during the imports below.
    with ChildPool() as child_pool:
        from tdac_agent.cli import verify as command

        return command.run(flags, options, noise, child_pool)
