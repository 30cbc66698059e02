"""Flags, and texts of flags, that several commands share."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Literal,
    Optional,
)

import typer

if TYPE_CHECKING:
    pass

number_flag = functools.partial(typer.Option, metavar="N")
dir_flag = functools.partial(typer.Option, metavar="DIR")
file_flag = functools.partial(typer.Option, metavar="FILE")
TASK = "Bundled task (`maze`, `epuck`, …), task.yaml, or run folder"
MAP_FILE = "Map image, ROS map.yaml, MovingAI .map, .npy grid"
WORLD_FILE = "Webots .wbt file"
VARIATION = (
    "Start poses: the task's own (nominal), within a body radius of it (jitter), "
    "jittered or any (mixed), any start and goal (random)."
)
WRAPPER = (
    "Observation wrapper, innermost first; repeatable: `goal-relative`, `closeness`, "
    "`guidance`, `map-view`, `flatten`, or `none`."
)
VIDEO = "Write a .mp4 or .gif video"
Speed = Annotated[
    Optional[float],  # noqa: UP045 - typer reads it at run time
    number_flag(
        "--speed",
        min=0.01,
        max=1000.0,
        help="Speed of the video, relative to real time.  [default: 1; more if it "
        "would last longer than a minute]",
    ),
]
RANGE_NOISE = "Noise of each range, standard deviation relative to the range."
WHEEL_SLIP = "Noise of each wheel's speed, standard deviation relative to the speed."
MOTOR_LAG = "Time constant of the wheel speeds, s."
DELAY = "Number of steps until an action takes effect."
WHEEL_GAINS = (
    "Largest hidden relative error of each wheel's speed, constant in an episode."
)
AXLE_ERROR = "Largest hidden relative error of the axle length, constant in an episode."
RANGE_DROPOUT = "Probability that a ray reads its maximum range; only on maps."
Controller = Annotated[
    str,
    typer.Argument(help="Controller file, or run folder, which brings its own task."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")]
TaskOption = Annotated[
    Optional[str],  # noqa: UP045 - typer reads it at run time
    typer.Option("--task", metavar="PATH", help=f"{TASK}.  [default: maze]"),
]
MapOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--map", metavar="PATH", help=f"{MAP_FILE}, or bundled map."),
]
WorldOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--world",
        metavar="PATH",
        help=f"{WORLD_FILE} with an e-puck, or bundled world.",
    ),
]
Ignore = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--ignore",
        metavar="NAME",
        help="Name or type of a world node to ignore although it may be solid; "
        "repeatable.",
    ),
]
Start = Annotated[
    Optional[tuple[float, float]],  # noqa: UP045
    typer.Option(
        "--start",
        metavar="X Y [YAW]",
        help="Start: px on a map, m in a world, also as X,Y; for YAW, see --heading.",
    ),
]
Goal = Annotated[
    Optional[tuple[float, float]],  # noqa: UP045
    typer.Option("--goal", metavar="X Y", help="Goal: px on a map, m in a world."),
]
Radius = Annotated[
    Optional[float],  # noqa: UP045
    number_flag("--robot-radius", help="Body radius, px.  [default: 15]"),
]
Heading = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        metavar="YAW",
        help="Start heading, rad, from +x towards +y (down on a map, up with "
        "--metres).",
    ),
]
RobotImage = Annotated[
    Optional[Path],  # noqa: UP045
    file_flag("--robot-image", help="Picture of the robot, nose to the right."),
]
Movers = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        metavar="KIND:COUNT",
        help="Moving obstacles on a map: `bounce:5` or `crowd:20`; a task.yaml can "
        "describe them in detail.  [default: none]",
    ),
]
Snap = Annotated[
    bool,
    typer.Option(
        "--snap",
        help="Move a start or goal that is not free to the nearest free place from "
        "which the other one can be reached.",
    ),
]
Metres = Annotated[
    bool,
    typer.Option(
        "--metres",
        help="The same as --frame metres.",
    ),
]
FrameOption = Annotated[
    Optional[Literal["pixels", "metres"]],  # noqa: UP045
    typer.Option(
        "--frame",
        help="Units of places, lengths and headings, given and printed, and of what a "
        "controller observes: pixels (y down), or metres in the map's frame as in ROS "
        "(map.yaml; y up). The controllers of an existing run or task keep theirs.  "
        "[default: pixels]",
    ),
]
Polarity = Annotated[
    Optional[Literal["dark", "light"]],  # noqa: UP045
    typer.Option(
        help="Obstacle pixels of the map image: dark or light.  [default: detected]"
    ),
]
Threshold = Annotated[
    Optional[float],  # noqa: UP045
    number_flag(
        help="Luminance above which a map pixel is light, from 0 to below 255.  "
        "[default: detected]"
    ),
]
Instructions = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--instructions",
        metavar="TEXT",
        help="Additional instructions for the model: a text, or a file with it.",
    ),
]
Suite = Annotated[
    Optional[Path],  # noqa: UP045
    dir_flag("--suite", help="Folder with additional test_*.py files to run."),
]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="For this command only, let a folder or file from elsewhere run and "
        "contact what it names; each item is listed.",
    ),
]
JitterSeed = Annotated[
    Optional[int],  # noqa: UP045
    number_flag(
        "--seed",
        min=0,
        help="Seed of the jittered starts.  [default: derived from a secret of this "
        "installation]",
    ),
]
Tier = Annotated[
    str, typer.Option(metavar="NAME", help="Sandbox tier; `tdac doctor` lists them.")
]
Profile = Annotated[
    Optional[Literal["policy", "paper"]],  # noqa: UP045
    typer.Option(
        help="Functions that the controller must define: `policy(obs)` only, or those "
        "of the paper.  [default: the task's]"
    ),
]
MODELS = "Models"
Learner = Annotated[
    str,
    typer.Option(
        metavar="MODEL",
        help="Model that writes controllers: `builtin` (a template, no language "
        "model), `anthropic:MODEL`, `openai:MODEL`, `command:PROGRAM`, `manual:DIR`, "
        "`replay:RUN` or `scripted:SCRIPT`.",
        rich_help_panel=MODELS,
    ),
]
Optimizer = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        metavar="MODEL",
        help="Model that repairs failed controllers and writes rules.  "
        "[default: the learner]",
        rich_help_panel=MODELS,
    ),
]
BaseUrl = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--base-url",
        metavar="URL",
        help="Server of the `openai:` or `anthropic:` models (vLLM, Ollama, LM Studio, "
        "…), for example http://localhost:8000/v1.",
        rich_help_panel=MODELS,
    ),
]
KeyOverHttp = Annotated[
    bool,
    typer.Option(
        "--key-over-http",
        help="Allow sending an API key unencrypted to a server on another machine.",
        rich_help_panel=MODELS,
    ),
]
MaxOutput = Annotated[
    Optional[int],  # noqa: UP045
    number_flag(
        "--max-output",
        min=1,
        help="Token limit of an answer, thinking included; doubled after an answer "
        "that was cut off.  [default: 16000]",
        rich_help_panel=MODELS,
    ),
]
BUDGET = "Budget"


def finite_cost(value: float | None) -> float | None:
    """The limit in USD; refuses `inf` and `nan`, which typer parses as numbers.

    Raises:
        RunError: The limit is not finite.
    """
    if value is not None and not math.isfinite(value):
        from tdac_agent.errors import RunError

        raise RunError("--max-cost must be finite")
    return value


MaxCost = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        "--max-cost",
        min=0.0,
        callback=finite_cost,
        metavar="USD",
        help="Cost limit of the whole run; the worst case of each question is reserved "
        "before it is asked.  [default: 2]",
        rich_help_panel=BUDGET,
    ),
]
MaxTokens = Annotated[
    Optional[int],  # noqa: UP045
    number_flag(
        "--max-tokens",
        min=0,
        help="Token limit of the whole run, input plus output.  [default: none; "
        "1000000 for a server with unknown prices]",
        rich_help_panel=BUDGET,
    ),
]
DISTURBED = "Disturbance of verify --robust and play --seed"
RangeNoise = Annotated[
    Optional[float],  # noqa: UP045
    number_flag(help=f"{RANGE_NOISE}  [default: 0.025]", rich_help_panel=DISTURBED),
]
WheelSlip = Annotated[
    Optional[float],  # noqa: UP045
    number_flag(help=f"{WHEEL_SLIP}  [default: 0.03]", rich_help_panel=DISTURBED),
]
MotorLag = Annotated[
    Optional[float],  # noqa: UP045
    number_flag(help=f"{MOTOR_LAG}  [default: 0]", rich_help_panel=DISTURBED),
]
Delay = Annotated[
    Optional[int],  # noqa: UP045
    number_flag(help=f"{DELAY}  [default: 1]", rich_help_panel=DISTURBED),
]
WheelGains = Annotated[
    Optional[float],  # noqa: UP045
    number_flag(help=f"{WHEEL_GAINS}  [default: 0]", rich_help_panel=DISTURBED),
]
AxleError = Annotated[
    Optional[float],  # noqa: UP045
    number_flag(help=f"{AXLE_ERROR}  [default: 0]", rich_help_panel=DISTURBED),
]
RangeDropout = Annotated[
    Optional[float],  # noqa: UP045
    number_flag(help=f"{RANGE_DROPOUT}  [default: 0]", rich_help_panel=DISTURBED),
]
