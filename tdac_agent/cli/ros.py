"""`tdac ros sim` and `tdac ros drive`: a robot and a node over DDS, without ROS."""

from __future__ import annotations

import importlib.util
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.ros_flags import DriveOptions, SimOptions
from tdac_agent.cli.sentences import print_plain
from tdac_agent.cli.task_choice import chosen_single
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.ros2.bag import Bag, check_packages
from tdac_agent.ros2.export import core_settings, settings_of
from tdac_agent.ros2.faults import STOPPING, read_fault
from tdac_agent.ros2.package.core import PERIODS
from tdac_agent.storage.files import write_atomic
from tdac_envs.core.errors import TaskError
from tdac_envs.core.extras import install_command

if TYPE_CHECKING:
    from tdac_agent.ros2.simulator import DriveReport


def sim(options: SimOptions, flags: TaskFlags) -> int:
    """Simulates a robot and prints its drive; returns 0 if it reached the goal."""
    faults = tuple(read_fault(text) for text in options.fault)
    task = chosen_single(flags)
    settings = settings_of(task)
    dead_man = _dead_man(settings, options.dead_man)
    require_dds()
    if options.mcap is not None:
        check_packages(options.mcap)
    from tdac_agent.ros2.dds import Bus
    from tdac_agent.ros2.robot import Robot
    from tdac_agent.ros2.simulator import Simulator

    robot = Robot(
        task,
        settings,
        dead_man=dead_man,
        disturbed=options.disturbed,
        seed=options.seed,
    )
    robot.layout  # noqa: B018 - a task without even rays is refused before it waits
    bus = Bus(options.domain, network=options.network, stamped=options.stamped)
    console = Console(stderr=options.as_json)
    where = "the network" if options.network else "this machine"
    time = "real" if options.real_time else "simulated"
    print_plain(
        console,
        f"{task.name}: a robot on domain {options.domain}, {where}, {time} time; it "
        "waits for /cmd_vel",
    )
    bag = None if options.mcap is None else Bag()
    simulator = Simulator(
        robot,
        bus,
        real_time=options.real_time,
        faults=faults,
        bag=bag,
        say=lambda text: print_plain(Console(stderr=True), text),
    )
    try:
        report = simulator.run(options.seconds)
    finally:  # also what was recorded until an interruption
        if bag is not None and options.mcap is not None:
            write_atomic(options.mcap, bag.finish())
            print_plain(console, f"wrote {options.mcap}")
    if options.as_json:
        print_json({"schema_version": 1, "task": task.name, **asdict(report)})
    else:
        _show(report, settings, dead_man, console)
    return 0 if report.outcome == "reached" else 1


def drive(options: DriveOptions) -> int:
    """Drives a package; returns 0 if it reached the goal."""
    require_dds()
    from tdac_agent.ros2.dds import Bus
    from tdac_agent.ros2.drive import Node, open_package

    package = open_package(options.package, trust=options.trust)
    dead_man = options.dead_man
    if dead_man is None:
        dead_man = PERIODS * float(package.settings["dt"])
    bus = Bus(options.domain, network=options.network, stamped=options.stamped)
    console = Console(stderr=options.as_json)
    node = Node(
        package,
        bus,
        dead_man=dead_man,
        sim_time=not options.real_time,
        origin=options.origin,
        max_localiser_age=options.max_localiser_age,
        max_speed=options.max_speed or 0.0,
        recover=options.recover,
        resample_scan=options.resample_scan,
        max_jump=options.max_jump or 0.0,
        max_deviation=options.max_deviation or 0.0,
        any_start=options.any_start,
        any_map=options.any_map,
        say=lambda text: print_plain(console, text),
    )
    last = node.run(options.seconds)
    if options.as_json:
        record = {"state": last.state, "reason": last.reason}
        print_json({"schema_version": 1, **record, "commands": node.core.commands})
    else:
        print_plain(console, f"{node.core.commands} commands")
    return 0 if last.state == "reached" else 1


def require_dds() -> None:
    """Checks that DDS can be used.

    Raises:
        TaskError: Its package is not installed.
    """
    if importlib.util.find_spec("cyclonedds") is None:
        raise TaskError(f"this needs Cyclone DDS: {install_command('ros2')}")


def _dead_man(settings: dict[str, Any], given: float | None) -> float:
    """The timer of the robot, s.

    Raises:
        TaskError: It is 0, or longer than a core allows.
    """
    seconds = PERIODS * float(settings["dt"]) if given is None else given
    try:
        core_settings(settings, dead_man=seconds)
    except ValueError as error:
        raise TaskError(str(error)) from None
    return seconds


def _show(
    report: DriveReport, settings: dict[str, Any], dead_man: float, console: Console
) -> None:
    table = Table(show_header=False)
    table.add_row("outcome", report.outcome + f" {escape(report.contact)}".rstrip())
    table.add_row("control periods", str(report.steps))
    table.add_row("commands", str(report.commands))
    table.add_row("stops on the way", str(report.stops))
    table.add_row("driven", f"{report.way:.3f} m")
    table.add_row("smallest gap", f"{1000 * report.smallest_gap:.1f} mm")
    console.print(table)
    most = core_settings(settings, dead_man=dead_man).stops_within()
    for fault in report.faults:
        name = f"{fault['kind']}@{fault['begin']:g}+{fault['lasts']:g}"
        what = "stood after" if fault["stood"] else "did not stand; drove"
        row = STOPPING.get(fault["kind"])
        stated = "" if row is None else f" (stated: {most[row]:.3f} m)"
        print_plain(console, f"{name}: {what} {fault['way']:.3f} m{stated}")
    colour = "green" if report.outcome == "reached" else "red"
    console.print(f"[bold {colour}]{report.outcome}[/]")
