"""The commands `tdac ros sim` and `tdac ros drive`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import typer

from tdac_agent.cli.shared_options import json_option, trust_option
from tdac_agent.cli.task_flags import ONLY_FOR_SYNTH, TaskFlags
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option

ros_app = typer.Typer(
    no_args_is_help=True,
    help="Drive an exported ROS 2 package in a simulation, over DDS, without ROS.",
)
app = typer.Typer()
app.add_typer(ros_app, name="ros")

_domain = partial(
    option, 0, "Number of the DDS domain (`ROS_DOMAIN_ID`).", least=0, most=101
)
_network = partial(
    option,
    False,
    "Reach other machines, as `CYCLONEDDS_URI` says.  [default: this machine alone]",
)
_stamped = partial(option, False, "Commands are `TwistStamped`, not `Twist`.")
_dead_man = partial(
    option,
    None,
    "Time after which the robot stops by itself without a command, s.  [default: three "
    "control periods]",
    metavar="SECONDS",
)
_real_time = partial(
    option,
    False,
    "Drive in real time, whatever the other side does.  [default: simulated time, in "
    "which each control period waits for its command]",
)


@dataclass(frozen=True, slots=True)
class SimOptions:
    """The further flags of `tdac ros sim`."""

    real_time: bool = _real_time()
    seconds: float = option(
        600.0, "Longest drive, simulated seconds.", metavar="SECONDS", least=1
    )
    fault: tuple[str, ...] = option(
        (),
        "What goes wrong, as KIND@BEGIN+SECONDS after the first motion; repeatable: "
        "no-scans, late-scans, old-scans, nan-scans, zero-scans, some-nan, no-poses, "
        "pose-jump, unsure-pose, second-publisher.",
        metavar="FAULT",
    )
    disturbed: bool = option(
        False, "The robot has the errors of its file: noise, slip, latency."
    )
    seed: int = option(0, "Seed of these errors and of the start.", least=0)
    mcap: Path | None = option(
        None, "Record all topics in a .mcap file.", metavar="FILE"
    )
    dead_man: float | None = _dead_man()
    domain: int = _domain()
    network: bool = _network()
    stamped: bool = _stamped()
    as_json: bool = json_option()


@ros_app.command(
    "sim",
    epilog="Examples: `tdac ros sim runs/depot-1`; `tdac ros sim runs/depot-1 "
    "--real-time --fault nan-scans@3+1.5`",
)
@typed_options("ros:sim", without=(*ONLY_FOR_SYNTH, "set_name"))
def sim(options: SimOptions, flags: TaskFlags) -> None:
    """Be the robot of a task: publish /scan, /odom, /tf, /clock; obey /cmd_vel.

    It waits for a node, such as `tdac ros drive`. Exits with 0 if the goal was reached
    without a contact.
    """


@dataclass(frozen=True, slots=True)
class DriveOptions:
    """The flags of `tdac ros drive`."""

    package: Path = option(..., "Folder of `tdac export ros2`.", argument=True)
    real_time: bool = _real_time()
    seconds: float | None = option(
        None, "End after so many seconds.", metavar="SECONDS", least=1
    )
    any_start: bool = option(
        False, "Begin where the robot stands, though no verified drive began there."
    )
    any_map: bool = option(
        False,
        "The localiser may have another map than the controller; both must have one "
        "frame.",
    )
    resample_scan: bool = option(
        False,
        "Take scans with another or a varying number of rays than the robot file, and "
        "with gaps, as those of the LDS-02.",
    )
    max_jump: float | None = option(
        None,
        "Largest distance of a pose from where the commands lead, m.  [default: the "
        "radius of the robot]",
        metavar="METRES",
    )
    max_deviation: float | None = option(
        None,
        "Largest standard deviation of x and y that the localiser may state, m.  "
        "[default: three times the pose noise of the verification, at most the radius]",
        metavar="METRES",
    )
    max_localiser_age: float = option(
        1.0,
        "Largest time in which the localiser does not renew its transform, s.",
        metavar="SECONDS",
    )
    max_speed: float | None = option(
        None,
        "Drive no faster, m/s.  [default: the speed of the robot]",
        metavar="SPEED",
    )
    recover: bool = option(
        False,
        "Drive on by itself after each stop.  [default: a second publisher, a jump of "
        "the pose, data that are missing for more than 2 s and a controller that is "
        "mostly late end the drive]",
    )
    origin: tuple[float, float, float] | None = option(
        None,
        "Take the pose from /odom, whose origin has this pose on the map (m, rad).  "
        "[default: tf, map to base_link]",
        metavar="X Y YAW",
    )
    dead_man: float | None = _dead_man()
    domain: int = _domain()
    network: bool = _network()
    stamped: bool = _stamped()
    trust: bool = trust_option()
    as_json: bool = json_option()


@ros_app.command("drive", epilog="Example: `tdac ros drive depot_drive`")
@typed_options("ros:drive")
def drive(options: DriveOptions) -> None:
    """Drive a package of `tdac export ros2` over DDS, as its ROS node would.

    Its controller runs with your rights, outside the sandbox. Exits with 0 if it
    reached the goal.
    """
