"""The command `tdac verify`."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Annotated, Optional

import typer

from tdac_agent.cli.options import (
    AxleError,
    Controller,
    Delay,
    JitterSeed,
    Json,
    MotorLag,
    Profile,
    RangeDropout,
    RangeNoise,
    Suite,
    Tier,
    Trust,
    WheelGains,
    WheelSlip,
    dir_flag,
    file_flag,
    number_flag,
)
from tdac_agent.cli.task_flags import NamedTask, takes_task

app = typer.Typer()


@app.command(
    epilog="Examples: `tdac verify controller.py --task maze`; "
    "`tdac verify runs/maze-1`; `tdac verify runs/maze-1 --robust 200`"
)
@takes_task()
def verify(
    controller: Controller,
    named_task: NamedTask,
    profile: Profile = None,
    paper: Annotated[
        bool,
        typer.Option("--paper", help="Run only the nominal episode, as in the paper."),
    ] = False,
    suite: Suite = None,
    trust: Trust = False,
    tier: Tier = "auto",
    seed: JitterSeed = None,
    junit: Annotated[
        Optional[Path],  # noqa: UP045
        file_flag(help="Write a JUnit XML report."),
    ] = None,
    out: Annotated[
        Optional[Path],  # noqa: UP045
        dir_flag(
            "--out",
            help="Folder for report.json (and episodes.json), the trajectories and a "
            "picture of each failed episode.",
        ),
    ] = None,
    as_json: Json = False,
    robust: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            min=1,
            help="If the controller is verified, run N disturbed episodes and print "
            "their success rate.",
            rich_help_panel="Robustness",
        ),
    ] = None,
    first_seed: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            min=0,
            help="Seed of the first disturbed episode.  [default: as for --seed]",
            rich_help_panel="Robustness",
        ),
    ] = None,
    accept_at: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(
            metavar="RATE",
            help="Stop as soon as a sequential test decides between this success rate "
            "and one lower by --margin; exit 0 only if it accepts this one.",
            rich_help_panel="Robustness",
        ),
    ] = None,
    margin: Annotated[
        Optional[float],  # noqa: UP045
        number_flag(
            help="Difference between the two rates of --accept-at.  [default: 0.05]",
            rich_help_panel="Robustness",
        ),
    ] = None,
    range_noise: RangeNoise = None,
    wheel_slip: WheelSlip = None,
    motor_lag: MotorLag = None,
    delay: Delay = None,
    wheel_gains: WheelGains = None,
    axle_error: AxleError = None,
    range_dropout: RangeDropout = None,
    set_name: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--set",
            metavar="NAME",
            help="Task set (`tdac sets`) or set.yaml: drive on worlds that the "
            "controller has never seen; exit 0 only if a sequential test accepts it.",
            rich_help_panel="Task set",
        ),
    ] = None,
    split: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            metavar="NAME",
            help="dev, test or hidden.  [default: test]",
            rich_help_panel="Task set",
        ),
    ] = None,
    worlds: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            "-n",
            "--worlds",
            min=1,
            help="Drive on N worlds and print the scores, without a verdict.",
            rich_help_panel="Task set",
        ),
    ] = None,
    salt_file: Annotated[
        Optional[Path],  # noqa: UP045
        file_flag(
            "--salt-file",
            help="File with the salt of the hidden split, 16 bytes or more.",
            rich_help_panel="Task set",
        ),
    ] = None,
    hidden_folder: Annotated[
        Optional[Path],  # noqa: UP045
        dir_flag(
            "--hidden-folder",
            help="For a set of real maps: a folder of held-out maps with an "
            "index.json; needs --split hidden.",
            rich_help_panel="Task set",
        ),
    ] = None,
) -> None:
    """Test a controller in the sandbox; exit 0 only if all tests pass."""
    # Imported objects live until exit: collecting them is a waste of time.
    gc.disable()
    from tdac_agent.verification.judge.child_pool import ChildPool

    # Its first process starts during the imports below.
    with ChildPool() as child_pool:
        from tdac_agent.cli import verify as command
        from tdac_agent.cli.robust_flags import DisturbanceFlags, RobustFlags
        from tdac_agent.cli.set_flags import SetFlags
        from tdac_agent.tasks.task_file import SET_FILE

        disturbed = DisturbanceFlags(
            range_noise=range_noise,
            wheel_slip=wheel_slip,
            motor_lag=motor_lag,
            delay=delay,
            wheel_gains=wheel_gains,
            axle_error=axle_error,
            range_dropout=range_dropout,
        )
        wanted = RobustFlags(robust, first_seed, accept_at, margin, disturbed)
        brings = (Path(controller) / SET_FILE).is_file() and not named_task().words()
        if set_name is None and brings:
            set_name = controller  # the run's own task set
        on_set = SetFlags(set_name, split, worlds, salt_file, hidden_folder)
        if on_set != SetFlags():
            from tdac_agent.cli import verify_set

            on_set.check(
                named_task(),
                wanted,
                {
                    "--profile": profile,
                    "--paper": paper,
                    "--suite": suite,
                    "--trust": trust,
                    "--seed": seed,
                    "--junit": junit,
                },
            )
            raise typer.Exit(
                verify_set.run(controller, on_set, tier, out, as_json, child_pool)
            )
        code = command.run(
            controller,
            named_task(),
            profile,
            paper,
            suite,
            trust,
            tier,
            seed,
            junit,
            out,
            as_json,
            wanted,
            child_pool,
        )
    raise typer.Exit(code)
