"""The command line: `tdac map | world | synth | verify | play | evaluate | …`.

Exit codes: 0 yes, 1 no (not verified), 2 usage or infeasible task, 3 infrastructure,
4 budget, 130 interrupted.
"""

from __future__ import annotations

import signal
import sys
import traceback
from pathlib import Path
from typing import Annotated, Literal, NoReturn, Optional

import typer

from tdac_agent.commands.options import (
    Delay,
    Goal,
    Heading,
    Ignore,
    Json,
    MapOption,
    Metres,
    MotorLag,
    Profile,
    Radius,
    RangeNoise,
    Snap,
    Start,
    TaskOption,
    Tier,
    WheelSlip,
    WorldOption,
    task_flags,
    with_heading,
)
from tdac_agent.commands.synth_flags import EPILOG, synth
from tdac_agent.commands.train_flags import train
from tdac_agent.commands.webots_flags import export_app, webots_app

app = typer.Typer(
    name="tdac",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help=(
        "Write a robot controller from tests, and know that it works.\n\n"
        "Start with `tdac synth`: it turns the bundled maze image into a verified "
        "`controller.py`, with no key and no network."
    ),
)
app.add_typer(webots_app, name="webots")
app.add_typer(export_app, name="export")
app.command(
    epilog="Examples: `tdac train --task maze`; `tdac train --task epuck --algo sac "
    "--seed 1`; `tdac train --task maze --task office --variation random`"
)(train)


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.")
    ] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed

        typer.echo(f"tdac {installed('tdac')}")
        raise typer.Exit


@app.command("map", epilog="Example: `tdac map plan.png --start 90 302 --goal 178 386`")
def map_command(
    image: Annotated[str, typer.Argument(help="Map image or map file.")],
    start: Start = None,
    goal: Goal = None,
    robot_radius: Radius = None,
    snap: Snap = False,
    metres: Metres = False,
    preset: Annotated[
        Literal["default", "paper"],
        typer.Option(help="`default`, or `paper` for the literal grid search."),
    ] = "default",
    out: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--out", help="Folder to write.  [default: NAME-map]"),
    ] = None,
    as_json: Json = False,
) -> None:
    """Turn a map image into an occupancy grid, and show how.

    Without start and goal it writes a preview with rulers to read pixels off.
    """
    from tdac_agent.commands import maps

    maps.run(image, start, goal, robot_radius, snap, metres, preset, out, as_json)


@app.command("world", epilog="Example: `tdac world maze.wbt --png maze.png`")
def world_command(
    file: Annotated[
        str, typer.Argument(help="Webots world, V6 to R2025a, or a bundled name.")
    ],
    png: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--png", metavar="OUT", help="Draw it from above."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Show what is in a Webots world: e-pucks, goal, arena, obstacles."""
    from tdac_agent.commands import world

    world.run(file, png, as_json)


app.command(epilog=EPILOG)(synth)


@app.command(
    epilog="Examples: `tdac verify controller.py --task maze`; "
    "`tdac verify runs/maze-1`; `tdac verify runs/maze-1 --robust 200`"
)
def verify(
    controller: Annotated[str, typer.Argument(help="controller.py, or a run folder.")],
    task: TaskOption = None,
    map_image: MapOption = None,
    world: WorldOption = None,
    ignore: Ignore = None,
    start: Start = None,
    goal: Goal = None,
    heading: Heading = None,
    robot_radius: Radius = None,
    snap: Snap = False,
    metres: Metres = False,
    profile: Profile = None,
    paper: Annotated[
        bool, typer.Option("--paper", help="Nominal start only, as in the paper.")
    ] = False,
    suite: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Folder with your own test_*.py files, run as well."),
    ] = None,
    tier: Tier = "auto",
    seed: Annotated[int, typer.Option(min=0, help="Of the jittered starts.")] = 0,
    junit: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Write a JUnit XML report."),
    ] = None,
    out: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--out",
            help="Folder for report.json (and robust.json), the trajectories, and a "
            "picture of each episode that failed.",
        ),
    ] = None,
    as_json: Json = False,
    robust: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(
            min=1,
            metavar="N",
            help="Once verified, run N disturbed episodes and give the success rate.",
            rich_help_panel="Robustness",
        ),
    ] = None,
    first_seed: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(
            min=0,
            help="Seed of the first disturbed episode.  [default: 0]",
            rich_help_panel="Robustness",
        ),
    ] = None,
    accept_at: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(
            metavar="RATE",
            help="Stop as soon as a sequential test tells this success rate from one "
            "that is --margin lower; exit 0 only if accepted.",
            rich_help_panel="Robustness",
        ),
    ] = None,
    margin: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(
            help="See --accept-at.  [default: 0.05]", rich_help_panel="Robustness"
        ),
    ] = None,
    range_noise: RangeNoise = None,
    wheel_slip: WheelSlip = None,
    motor_lag: MotorLag = None,
    delay: Delay = None,
) -> None:
    """Test a controller in the sandbox; exit 0 only if every test passed."""
    from tdac_agent.commands import verify as command
    from tdac_agent.commands.robust_flags import DisturbanceFlags, RobustFlags

    spec = task_flags(
        task, map_image, world, ignore, start, goal, heading, robot_radius, None, snap,
        metres, None,
    )  # fmt: skip
    disturbed = DisturbanceFlags(range_noise, wheel_slip, motor_lag, delay)
    wanted = RobustFlags(robust, first_seed, accept_at, margin, disturbed)
    raise typer.Exit(
        command.run(
            controller,
            spec,
            profile,
            paper,
            suite,
            tier,
            seed,
            junit,
            out,
            as_json,
            wanted,
        )
    )


@app.command(
    epilog="Examples: `tdac play runs/maze-1 --video maze.mp4`; "
    "`tdac play runs/maze-1 --seed 17`"
)
def play(
    controller: Annotated[str, typer.Argument(help="controller.py, or a run folder.")],
    task: TaskOption = None,
    map_image: MapOption = None,
    world: WorldOption = None,
    ignore: Ignore = None,
    start: Start = None,
    goal: Goal = None,
    heading: Heading = None,
    robot_radius: Radius = None,
    snap: Snap = False,
    metres: Metres = False,
    video: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Write .mp4 or .gif instead of opening a window."),
    ] = None,
    episode: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            help="Episode of the suite, of its --seed 0: `nominal`, `jitter 1` …  "
            "[default: nominal]"
        ),
    ] = None,
    seed: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(min=0, help="The disturbed episode of this seed instead."),
    ] = None,
    tier: Tier = "auto",
    range_noise: RangeNoise = None,
    wheel_slip: WheelSlip = None,
    motor_lag: MotorLag = None,
    delay: Delay = None,
) -> None:
    """Show one episode of a controller, run in the sandbox.

    It is one of those of `tdac verify`: of the suite, or with --seed of --robust.
    """
    from tdac_agent.commands import play as command
    from tdac_agent.commands.robust_flags import DisturbanceFlags

    spec = task_flags(
        task, map_image, world, ignore, start, goal, heading, robot_radius, None, snap,
        metres, None,
    )  # fmt: skip
    disturbed = DisturbanceFlags(range_noise, wheel_slip, motor_lag, delay)
    raise typer.Exit(
        command.run(controller, spec, video, episode, seed, disturbed, tier)
    )


@app.command(
    epilog="Examples: `tdac evaluate reference builtin go-to-goal --task maze "
    "--task epuck`; `tdac evaluate runs/maze-1 ppo.zip --task maze --out compared`"
)
def evaluate(
    policies: Annotated[
        list[str],
        typer.Argument(
            metavar="POLICY...",
            help="controller.py files, run folders, .zip files of stable-baselines3, "
            "`reference`, `builtin`, `follow-guidance`, `go-to-goal`, `random`.",
        ),
    ],
    tasks: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--task",
            help="Bundled name, task.yaml, or run folder; repeatable.  [default: maze]",
        ),
    ] = None,
    episodes: Annotated[
        int, typer.Option(min=1, help="Of each policy on each task.")
    ] = 100,
    seed: Annotated[
        int, typer.Option(min=0, help="Of the episodes, the same for all policies.")
    ] = 0,
    variation: Annotated[
        Literal["nominal", "jitter", "random"],
        typer.Option(
            help="Starts: the task's own, within a body radius of it, or anywhere, "
            "with any goal."
        ),
    ] = "jitter",
    wrappers: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--wrapper",
            metavar="NAME",
            help="Of a .zip that does not say it, innermost first; repeatable: "
            "`goal-relative`, `guidance`, `flatten`, or `none`.",
        ),
    ] = None,
    csv: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--csv", metavar="FILE", help="Write a row for each episode."),
    ] = None,
    out: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--out",
            metavar="DIR",
            help="Write evaluation.json, episodes.csv, timing.csv and, of each task, a "
            "picture with the ways of all policies.",
        ),
    ] = None,
    tier: Tier = "auto",
    as_json: Json = False,
) -> None:
    """Compare policies of any kind: same tasks, same seeds, same judge."""
    from tdac_agent.commands import evaluate as command

    raise typer.Exit(
        command.run(
            policies,
            tasks or ["maze"],
            episodes,
            seed,
            variation,
            wrappers,
            csv,
            out,
            tier,
            as_json,
        )
    )


@app.command(
    "check-suite",
    epilog="Example: `tdac check-suite --task office --suite my_tests`",
)
def check_suite(
    task: TaskOption = None,
    map_image: MapOption = None,
    world: WorldOption = None,
    ignore: Ignore = None,
    start: Start = None,
    goal: Goal = None,
    heading: Heading = None,
    robot_radius: Radius = None,
    snap: Snap = False,
    metres: Metres = False,
    suite: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Folder with your own test_*.py files, run as well."),
    ] = None,
    profile: Profile = None,
    tier: Tier = "auto",
    seed: Annotated[int, typer.Option(min=0, help="Of the jittered starts.")] = 0,
    repeats: Annotated[
        int, typer.Option(min=1, help="Verifications of each, which must agree.")
    ] = 5,
    as_json: Json = False,
) -> None:
    """Let a suite prove itself: a reference must pass it, bad controllers must not."""
    from tdac_agent.commands import check_suite as command

    spec = task_flags(
        task, map_image, world, ignore, start, goal, heading, robot_radius, None, snap,
        metres, None,
    )  # fmt: skip
    raise typer.Exit(command.run(spec, profile, suite, tier, seed, repeats, as_json))


@app.command(epilog="Example: `tdac demo`")
def demo(
    out: Annotated[
        Path | None, typer.Option(help="Run folder [default: runs/demo-N].")
    ] = None,
    as_json: Json = False,
) -> None:
    """Replay a recorded run of a language model: its answers, your machine's tests."""
    from tdac_agent.commands import demo as command

    raise typer.Exit(command.run(out, as_json))


@app.command("rules", epilog="Example: `tdac rules runs/office-1`")
def rules_command(
    run: Annotated[Path, typer.Argument(help="A run folder.")], as_json: Json = False
) -> None:
    """Show what a run has learnt: each rule, where it came from, what came of it."""
    from tdac_agent.commands import rules

    raise typer.Exit(rules.run(run, as_json))


@app.command(
    "report",
    epilog="Examples: `tdac report runs/office-1`; `tdac report runs --out all.html`",
)
def report_command(
    place: Annotated[Path, typer.Argument(help="A run folder, or a folder of runs.")],
    out: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--out", help="The file.  [default: report.html in the folder]"),
    ] = None,
) -> None:
    """Make one HTML file of runs: verdicts, failures, code, rules, animations."""
    from tdac_agent.commands import report

    raise typer.Exit(report.run(place, out))


@app.command("runs", epilog="Examples: `tdac runs`; `tdac runs results --json`")
def runs_command(
    folder: Annotated[Path, typer.Argument(help="Where the run folders are.")] = Path(
        "runs"
    ),
    as_json: Json = False,
) -> None:
    """List run folders: how far each came, what it took, how to go on with it."""
    from tdac_agent.commands import runs

    raise typer.Exit(runs.run(folder, as_json))


@app.command(epilog="Example: `tdac doctor`")
def doctor(as_json: Json = False) -> None:
    """Say what works on this machine: sandbox tiers, window, video, extras, keys."""
    from tdac_agent.commands import doctor as command

    raise typer.Exit(command.run(as_json))


def main() -> None:
    """Entry point of the `tdac` script: every known error is one clear line."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)
    try:
        words = with_heading(sys.argv[1:])
        code = app(words, prog_name="tdac", standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except Exception as error:
        _explain(error)
    if code == 130:
        _fail("interrupted", 130)
    sys.exit(code or 0)


def _explain(error: Exception) -> NoReturn:
    from tdac_agent.errors import Fault
    from tdac_envs.errors import TdacError

    if hasattr(error, "format_message"):  # usage, as typer found it
        # Without any word there is help, and nothing more to say.
        reason = error.format_message().rstrip(".")
        if not reason:
            sys.exit(2)
        _fail(f"error: {reason}; see tdac --help", 2)
    if isinstance(error, TdacError):
        _fail(f"error: {error}", 2)
    if isinstance(error, Fault):
        _fail(f"infrastructure fault: {error}", 3)
    if isinstance(error, OSError) and error.filename:
        _fail(f"error: {error.filename}: {error.strerror}", 3)
    traceback.print_exception(error)
    _fail("internal error: please report the lines above", 3)


def _fail(message: str, code: int) -> NoReturn:
    sys.stdout.flush()
    print(" ".join(message.split()), file=sys.stderr)
    sys.exit(code)


if __name__ == "__main__":
    main()
