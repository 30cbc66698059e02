"""Flags that several commands share."""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable, Collection
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    Optional,
    Protocol,
    get_type_hints,
)

import typer

if TYPE_CHECKING:
    from tdac_agent.cli.flags import TaskFlags

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")]
TaskOption = Annotated[
    Optional[str],  # noqa: UP045 - typer reads it at run time
    typer.Option(
        "--task",
        help="Bundled name (`maze`, `epuck`, …), task.yaml, or run folder.  "
        "[default: maze]",
    ),
]
MapOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--map", help="Map image, ROS map.yaml, MovingAI .map, or bundled."),
]
WorldOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--world", help="Webots world of an e-puck: a .wbt file, or bundled."),
]
Ignore = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--ignore",
        metavar="NAME",
        help="Name or type of a node of the world that may be missing; repeatable.",
    ),
]
Start = Annotated[
    Optional[tuple[float, float]],  # noqa: UP045
    typer.Option(
        "--start",
        metavar="X Y [YAW]",
        help="Start: px on a map, m in a world; its third number is as --heading.",
    ),
]
Goal = Annotated[
    Optional[tuple[float, float]],  # noqa: UP045
    typer.Option("--goal", metavar="X Y", help="Goal: px on a map, m in a world."),
]
Radius = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--robot-radius", help="Body radius, px.  [default: 15]"),
]
Heading = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        "--heading", help="Start heading, rad, from +x towards +y (down on a map)."
    ),
]
RobotImage = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option("--robot-image", help="Picture of the robot, nose to the right."),
]
Snap = Annotated[
    bool, typer.Option("--snap", help="Move start and goal to the nearest free place.")
]
Metres = Annotated[
    bool,
    typer.Option("--metres", help="Lengths are metres in the map's frame (map.yaml)."),
]
Polarity = Annotated[
    Optional[Literal["dark", "light"]],  # noqa: UP045
    typer.Option(
        help="Which pixels of the map image are obstacles.  [default: found out]"
    ),
]
Threshold = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        metavar="LUMINANCE",
        help="Above it a pixel of the map image is light, 0 to 255.  "
        "[default: found out]",
    ),
]
Instructions = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--instructions", help="Your own text to the model, or a file with it."
    ),
]
Suite = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option("--suite", help="Folder with your own test_*.py files, run as well."),
]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="Let a folder or file of somebody else's do what it wants: it is listed. "
        "Holds for this command alone.",
    ),
]
JitterSeed = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option(
        "--seed",
        min=0,
        help="Of the jittered starts.  [default: follows from controller, task and a "
        "secret of this installation]",
    ),
]
Tier = Annotated[
    str,
    typer.Option(help="Sandbox tier; see `tdac doctor`."),
]
Profile = Annotated[
    Optional[Literal["policy", "paper"]],  # noqa: UP045
    typer.Option(help="What the file must define.  [default: the task's own]"),
]
MODELS = "Models"
Learner = Annotated[
    str,
    typer.Option(
        metavar="MODEL",
        help="Who writes: `builtin` (a template, no model), `anthropic:MODEL`, "
        "`openai:MODEL`, `command:PROGRAM`, `manual:DIR`, `replay:RUN` or "
        "`scripted:SCRIPT`.",
        rich_help_panel=MODELS,
    ),
]
Optimizer = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        metavar="MODEL",
        help="Who edits what failed and writes rules.  [default: the learner]",
        rich_help_panel=MODELS,
    ),
]
BaseUrl = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--base-url",
        metavar="URL",
        help="Server of the `openai:` or `anthropic:` models: vLLM, Ollama, LM Studio, "
        "as in http://localhost:8000/v1.",
        rich_help_panel=MODELS,
    ),
]
KeyOverHttp = Annotated[
    bool,
    typer.Option(
        "--key-over-http",
        help="Let a key go unencrypted to a server on another machine.",
        rich_help_panel=MODELS,
    ),
]
MaxOutput = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option(
        "--max-output",
        min=1,
        metavar="TOKENS",
        help="Of an answer, thinking included; twice as many after a cut one.  "
        "[default: 16000]",
        rich_help_panel=MODELS,
    ),
]
BUDGET = "Budget"


def finite_cost(value: float | None) -> float | None:
    """A limit in USD as it is; `inf` and `nan` count as numbers on the command line.

    Raises:
        RunError: It is one of these.
    """
    if value is not None and not math.isfinite(value):
        from tdac_agent.errors import RunError

        raise RunError("expected --max-cost to be finite")
    return value


MaxCost = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        "--max-cost",
        min=0.0,
        callback=finite_cost,
        metavar="USD",
        help="Of the whole run; the worst case of each question is reserved before it "
        "is put.  [default: 2]",
        rich_help_panel=BUDGET,
    ),
]
MaxTokens = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option(
        "--max-tokens",
        min=0,
        metavar="N",
        help="Of the whole run, in and out together.  [default: no limit; 1000000 for "
        "a server of your own without a price]",
        rich_help_panel=BUDGET,
    ),
]
DISTURBED = "Disturbance of --robust, and of play --seed"
RangeNoise = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        help="Noise of each range, relative.  [default: 0.025]",
        rich_help_panel=DISTURBED,
    ),
]
WheelSlip = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        help="Noise of each wheel's speed in each step, relative.  [default: 0.03]",
        rich_help_panel=DISTURBED,
    ),
]
MotorLag = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        help="Time constant of the wheel speeds, s.  [default: 0]",
        rich_help_panel=DISTURBED,
    ),
]
Delay = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option(
        help="Steps by which an action is late.  [default: 1]",
        rich_help_panel=DISTURBED,
    ),
]


class NamedTask(Protocol):
    """What a command gets in the place of the flags that name its task.

    What reads them loads much, and is loaded when it is called.
    """

    def __call__(self) -> TaskFlags:
        """The task that they name."""


def task_flags(
    task: TaskOption = None,
    map_image: MapOption = None,
    world: WorldOption = None,
    ignore: Ignore = None,
    start: Start = None,
    goal: Goal = None,
    heading: Heading = None,
    robot_radius: Radius = None,
    robot_image: RobotImage = None,
    snap: Snap = False,
    metres: Metres = False,
    polarity: Polarity = None,
    threshold: Threshold = None,
    instructions: Instructions = None,
) -> TaskFlags:
    """The task that these flags of a command name."""
    from tdac_agent.cli.flags import TaskFlags

    return TaskFlags(
        task=task,
        map_image=map_image,
        world=world,
        ignore=tuple(ignore or ()),
        start=start,
        goal=goal,
        heading=heading,
        robot_radius=robot_radius,
        robot_image=robot_image,
        snap=snap,
        metres=metres,
        polarity=polarity,
        threshold=threshold,
        instructions=instructions,
    )


Command = Callable[..., None]
TOLD_TO_MODELS = ("robot_image", "instructions")
"""Flags of a task that matter to nobody but a model."""


def takes_task(
    *, but: Collection[str] = TOLD_TO_MODELS
) -> Callable[[Command], Command]:
    """Gives a command the flags of `task_flags` where it has a parameter `named_task`.

    Args:
        but: Flags that it does not have.
    """
    flags = [flag for flag in _parameters(task_flags) if flag.name not in but]

    def with_flags(command: Command) -> Command:
        own = _parameters(command)
        at = [parameter.name for parameter in own].index("named_task")

        @functools.wraps(command)
        def called(**given: Any) -> None:
            named = {flag.name: given.pop(flag.name) for flag in flags}
            command(**given, named_task=functools.partial(task_flags, **named))

        # Typer reads both.
        parameters = [*own[:at], *flags, *own[at + 1 :]]
        called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        called.__annotations__ = {p.name: p.annotation for p in parameters}
        return called

    return with_flags


def _parameters(function: Callable[..., Any]) -> list[inspect.Parameter]:
    """The parameters of a function, their annotations evaluated."""
    # The one name that is not there at run time is none of a parameter.
    hints = get_type_hints(function, localns={"TaskFlags": object}, include_extras=True)
    return [
        parameter.replace(annotation=hints[name])
        for name, parameter in inspect.signature(function).parameters.items()
    ]
