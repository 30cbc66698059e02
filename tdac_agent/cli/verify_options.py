"""Options of a verification, on a task or a task set."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tdac_agent.cli.shared_options import (
    CONTROLLER,
    Profile,
    json_option,
    out_option,
    profile_option,
    seed_option,
    suite_option,
    tier_option,
    trust_option,
)
from tdac_agent.cli.task_flags import SETS
from tdac_agent.option_fields import option
from tdac_agent.synthesis.options import ENGINES, Engine

ROBUST, PHYSICS = "Robustness", "Second opinion"


@dataclass(frozen=True, slots=True)
class VerifyOptions:
    """The further flags of `tdac verify`."""

    controller: str = option(..., CONTROLLER, argument=True)
    profile: Profile | None = profile_option()
    paper: bool = option(
        False,
        "Run only the nominal episode and end at `passed`, as in the paper.",
        scope="task",
    )
    confirm: bool = option(
        True,
        "Drive what passes all tests blind, from 93 disturbed starts; it is verified "
        "if at most one of these drives fails. Without it, end at `passed`.",
        "--confirm/--no-confirm",
        scope="task",
    )
    envelope: int | None = option(
        None,
        "After a pass, search for the smallest deviation with which it fails, with at "
        "most E episodes; see tdac falsify.",
        metavar="E",
        least=16,
    )
    suite: Path | None = suite_option()
    trust: bool = trust_option()
    tier: str = tier_option()
    seed: int | None = seed_option()
    recorded: Path | None = option(
        None,
        "Compare a recorded drive, a bag of ROS 2 or an .mcap file, with the "
        "controller: which commands differ, its gap and its stops. No test is run.",
        metavar="BAG",
        scope="task",
    )
    junit: Path | None = option(None, "Write a JUnit XML report.", metavar="FILE")
    out: Path | None = out_option(
        "Folder for report.json or episodes.json, the trajectories and a picture of "
        "each failed episode."
    )
    as_json: bool = json_option()
    physics: Engine = option(
        "exact",
        "Another physics that drives what arrives again, for a second opinion (extra "
        "`physics`); exact for none. mujoco-varied varies mass, friction, axle and "
        "wheels a little; mujoco-rays also measures the rays.",
        metavar=ENGINES,
        panel=PHYSICS,
        scope="task",
    )
    require_physics: bool = option(
        False,
        "Make the second opinion a test: all of these episodes must arrive.",
        panel=PHYSICS,
        scope="task",
        needs="--physics mujoco",
    )
    split: str = option(
        "test", "dev, test or hidden.", metavar="NAME", panel=SETS, scope="set"
    )
    episodes: int | None = option(
        None,
        "Drive N episodes and print the rates: of a task, disturbed ones, instead of "
        "the blind drives; on a set, on N worlds. Neither is a verdict.",
        "-n",
        "--robust",
        "--worlds",
        least=1,
    )
    salt_file: Path | None = option(
        None,
        "File with the salt of the hidden split, 16 bytes or more.",
        metavar="FILE",
        panel=SETS,
        scope="set",
    )
    hidden_folder: Path | None = option(
        None,
        "For a set of real maps: a folder of held-out maps with an index.json; needs "
        "--split hidden.",
        metavar="DIR",
        panel=SETS,
        scope="set",
    )
    first: int | None = option(
        None,
        "Seed of the first disturbed episode, or number of the first world.  "
        "[default: as for --seed, or 0]",
        "--first",
        "--first-seed",
        least=0,
        needs="-n N",
    )
    accept_at: float | None = option(
        None,
        "Stop as soon as a sequential test decides between this success rate and one "
        "lower by --margin; exit 0 only if it accepts this one.",
        metavar="RATE",
        panel=ROBUST,
        scope="task",
        needs="-n N",
    )
    margin: float = option(
        0.05,
        "Difference between the two rates of --accept-at.",
        panel=ROBUST,
        scope="task",
        needs="--accept-at RATE",
    )
