"""Flags that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Optional

import typer

if TYPE_CHECKING:
    from tdac_agent.commands.flags import TaskFlags

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
Snap = Annotated[
    bool, typer.Option("--snap", help="Move start and goal to the nearest free place.")
]
Metres = Annotated[
    bool,
    typer.Option("--metres", help="Lengths are metres in the map's frame (map.yaml)."),
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
MaxCost = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        "--max-cost",
        min=0.0,
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


def with_heading(words: list[str]) -> list[str]:
    """A command line in which `--start X Y YAW` is `--start X Y --heading YAW`."""
    for at, word in enumerate(words):
        if word == "--start" and len(words) > at + 3 and _is_number(words[at + 3]):
            rest = with_heading(words[at + 3 :])
            return [*words[: at + 3], "--heading", *rest]
    return words


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def task_flags(
    task: str | None,
    map_image: str | None,
    world: str | None,
    ignore: list[str] | None,
    start: tuple[float, float] | None,
    goal: tuple[float, float] | None,
    heading: float | None,
    robot_radius: float | None,
    robot_image: Path | None,
    snap: bool,
    metres: bool,
    instructions: str | None,
) -> TaskFlags:
    """The task that these flags of a command name."""
    from tdac_agent.commands.flags import TaskFlags

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
        instructions=instructions,
    )
